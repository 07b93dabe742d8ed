"""How the service runs: from the command line, or from environment variables for `uvicorn --factory`."""

import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationError,
)

from contactsense.scene import Scene, SceneError, describe
from service.sensors.source import LiveSource, SourceSettings
from service.sensors.streams import SensorError

PREFIX = "CONTACTSENSE_"
"""Environment variables are this and a setting's name in capitals, as `CONTACTSENSE_ROBOT_HOST`."""


class SettingsError(ValueError):
    """A setting cannot be used: which one, what was expected, what came."""


def _split(value: Any) -> Any:
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


Port = Annotated[int, Field(ge=0, le=65535)]
Counts = Annotated[tuple[PositiveFloat, PositiveFloat], BeforeValidator(_split)]
Names = Annotated[tuple[str, ...], BeforeValidator(_split)]
Fields = Annotated[tuple[str, ...], BeforeValidator(_split), Field(min_length=6, max_length=6)]


class Settings(BaseModel):
    """Settings of the service. Without `robot_host` it reads no sensors and only answers POST /v1/locate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene: Path | None = None
    """Scene file; without it `robot` on a table, with default sensors."""
    robot: str = "ur5e"
    """Robot to assume where there is no scene file."""
    host: str = "127.0.0.1"
    """Address to serve at."""
    port: Port = 8000
    """Port to serve at; 0 takes a free one."""
    robot_host: str | None = None
    """Address of the robot's controller."""
    robot_port: Port = 30004
    """Its RTDE port."""
    robot_client: Literal["rtde", "ur_rtde"] = "rtde"
    """Which client reads the robot: our own, which loses nothing, or ur_rtde in a process of its own."""
    robot_rate: PositiveFloat = 500.0
    """Robot samples a second [Hz]: 500 for e-Series, 125 for CB3."""
    ft_host: str | None = None
    """Address of the force/torque sensor under the base (Net F/T)."""
    ft_port: Port = 49152
    """Its RDT port (UDP)."""
    ft_http_port: Port = 80
    """Port of its configuration page."""
    ft_counts: Counts | None = None
    """Its counts per N and per Nm, instead of asking the configuration page."""
    ft_fields: Fields | None = None
    """Six RTDE fields that carry the base sensor's reading [N, Nm], instead of `ft_host`."""
    wrist_fields: Names = ("ft_raw_wrench",)
    """RTDE fields that carry the wrist sensor's reading [N, Nm], where the scene has such a sensor: one of
    six numbers, or six of one."""
    queue: PositiveInt = 500
    """Estimates kept for a slow reader of the stream before it loses the oldest."""

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> "Settings":
        """Settings from `CONTACTSENSE_*` variables; others of that prefix are not ours and left alone.

        Raises:
            SettingsError: A value cannot be used.
        """
        names = {PREFIX + name.upper(): name for name in cls.model_fields}
        return cls.checked({names[key]: value for key, value in environment.items() if key in names}, PREFIX)

    @classmethod
    def checked(cls, values: Mapping[str, object], name: str = "settings") -> "Settings":
        """Settings from loose values; `name` says in complaints where they come from.

        Raises:
            SettingsError: A value cannot be used.
        """
        try:
            return cls.model_validate(dict(values))
        except ValidationError as error:
            raise SettingsError(f"{name}: {describe(error)}") from None

    def load_scene(self) -> Scene:
        """The scene to work in.

        Raises:
            SettingsError: Its file cannot be used, or there is no such robot.
        """
        try:
            return (
                Scene.load(self.scene)
                if self.scene is not None
                else Scene.model_validate({"robot": self.robot})
            )
        except SceneError as error:
            raise SettingsError(str(error)) from None
        except ValidationError as error:
            raise SettingsError(describe(error)) from None
        except LookupError as error:
            raise SettingsError(str(error.args[0] if error.args else error)) from None

    def open_source(self, scene: Scene) -> Callable[[Scene], LiveSource] | None:
        """Maker of the source of samples, picklable; None where no robot is named.

        Raises:
            SettingsError: The scene asks for something that cannot be read this way.
        """
        if self.robot_host is None:
            return None
        if scene.base_wrench is not None and (self.ft_host is None) == (self.ft_fields is None):
            raise SettingsError(
                "the scene has a force/torque sensor under the base: expected either its address (ft_host) "
                f"or six RTDE fields (ft_fields), got {'both' if self.ft_host else 'neither'}; base_wrench: "
                "null in the scene does without"
            )
        settings = SourceSettings(
            robot_host=self.robot_host,
            robot_port=self.robot_port,
            client=self.robot_client,
            frequency=self.robot_rate,
            wrench_host=self.ft_host,
            wrench_port=self.ft_port,
            wrench_http_port=self.ft_http_port,
            wrench_counts=self.ft_counts,
            wrench_fields=self.ft_fields or (),
            wrist_fields=self.wrist_fields,
        )
        try:
            # A trial without the base sensor, whose client would begin to work at once.
            LiveSource(scene.model_copy(update={"base_wrench": None}), settings).close()
        except SensorError as error:
            raise SettingsError(str(error)) from None
        return partial(LiveSource, settings=settings)
