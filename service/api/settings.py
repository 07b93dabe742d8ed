"""How the service runs: from the command line, or from environment variables for `uvicorn --factory`."""

import ipaddress
import json
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
from contactsense.service.api.access import AccessRules
from contactsense.service.controllers.push_source import PushSource
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.events.journal import JournalSettings
from contactsense.service.live.listener import Listener
from contactsense.service.logs import Format, Level
from contactsense.service.reactions.state import ReactionSettings
from contactsense.service.recordings.clip_listener import ClipListener, RecordingSettings
from contactsense.service.sensors.live_source import LiveSource, SourceSettings
from contactsense.service.sensors.robot_stream import SensorError

PREFIX = "CONTACTSENSE_"
"""Environment variables are this and a setting's name in capitals, as `CONTACTSENSE_ROBOT_HOST`."""


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a service at that address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class SettingsError(ValueError):
    """A setting cannot be used: which one, what was expected, what was given."""


def _split(value: Any) -> Any:
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


def _from_json(value: Any) -> Any:
    """A group of settings from an environment variable."""
    return json.loads(value) if isinstance(value, str) and value.lstrip().startswith("{") else value


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
    constant_readings: bool = False
    """Whether readings may never change, as those of a simulator without noise; otherwise a signal that never
    changes counts as frozen and is ignored."""
    token: Annotated[str, Field(min_length=16)] | None = None
    """Token that every request must send as Authorization: Bearer; best given by the environment."""
    token_file: Path | None = None
    """File with the token, instead of `token`."""
    tls_certificate: Path | None = None
    """File with the certificate for TLS, and those up to the authority (PEM)."""
    tls_key: Path | None = None
    """File with its private key (PEM)."""
    insecure_no_tls: bool = False
    """Whether to serve other computers without TLS."""
    allowed_hosts: Names = ()
    """Names under which the service is reached, besides localhost and addresses in numbers."""
    allowed_origins: Names = ()
    """Web pages that may use it besides its own, such as https://panel.example."""
    max_connections: PositiveInt = 200
    """Open connections, WebSockets included."""
    max_body: PositiveInt = 8_000_000
    """Largest body of a request [bytes]."""
    max_request_rate: PositiveFloat = 500.0
    """Requests a second from one address."""
    reader_timeout: PositiveFloat = 10.0
    """A reader that takes nothing for so long is dropped [s]."""
    log_level: Level = "info"
    """What is not worth so much is not logged."""
    log_format: Format = "text"
    """Log lines for people, or JSON."""
    log_file: Path | None = None
    """File to log to instead of stderr; rotated at 10 MB, five files are kept."""
    queue: PositiveInt = 500
    """Estimates kept for a slow reader of the stream before it loses the oldest."""
    events: Annotated[JournalSettings, BeforeValidator(_from_json)] = JournalSettings()
    """Where events are kept, and how many. As JSON in an environment variable."""
    reactions: Annotated[ReactionSettings, BeforeValidator(_from_json)] = ReactionSettings()
    """Where the rules of reactions are. As JSON in an environment variable."""
    recording: Annotated[RecordingSettings, BeforeValidator(_from_json)] = RecordingSettings()
    """Clips and recordings, see `contactsense.service.recordings.clip_listener`."""
    controllers: Annotated[ControllerSettings, BeforeValidator(_from_json)] = ControllerSettings()
    """Interfaces for controllers. As JSON in an environment variable."""

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
        """Settings from loose values; `name` names their source in error messages.

        Raises:
            SettingsError: A value cannot be used.
        """
        try:
            return cls.model_validate(dict(values))
        except ValidationError as error:
            raise SettingsError(f"{name}: {describe(error)}") from None

    def access_rules(self) -> AccessRules:
        """Who may use the service.

        Raises:
            SettingsError: The file with the token cannot be read, or contains none.
        """
        token = self.token
        if self.token_file is not None:
            try:
                token = self.token_file.read_text().strip()
            except (OSError, UnicodeDecodeError) as error:
                raise SettingsError(
                    f"token_file: {self.token_file} cannot be read: {getattr(error, 'strerror', error)}"
                ) from None
            if len(token) < 16:
                raise SettingsError(
                    f"token_file: expected a token of at least 16 characters in {self.token_file}, "
                    f"got {len(token)}"
                )
        hosts = (*self.allowed_hosts, self.host) if self.host else self.allowed_hosts
        return AccessRules(token, hosts, self.allowed_origins)

    def check_exposure(self) -> None:
        """Make sure that nobody serves other computers by accident without a token or without TLS.

        Raises:
            SettingsError: What is missing.
        """
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise SettingsError("expected both tls_certificate and tls_key, or neither, got one")
        if is_loopback(self.host):
            return
        if self.access_rules().token is None:
            raise SettingsError(
                f"host {self.host} is reached by other computers: expected a token (CONTACTSENSE_TOKEN or "
                "token_file), got none"
            )
        if self.tls_certificate is None and not self.insecure_no_tls:
            raise SettingsError(
                f"host {self.host} is reached by other computers: expected tls_certificate and tls_key, or "
                "--insecure-no-tls for a network that you trust, got neither"
            )

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

    def listeners(self) -> tuple[Callable[[Scene], Listener], ...]:
        """Makers of the pipeline's listeners, picklable."""
        if self.recording.folder is None:
            return ()
        return (partial(ClipListener, settings=self.recording, rate=self.robot_rate),)

    def open_source(self, scene: Scene) -> Callable[[Scene], LiveSource | PushSource] | None:
        """Maker of the source of samples, picklable; None where no robot is named.

        Raises:
            SettingsError: The scene requires something that cannot be read this way.
        """
        if self.controllers.source == "push":
            return partial(PushSource, path=self.controllers.socket_path)
        if self.robot_host is None:
            return None
        if scene.base_wrench is not None and (self.ft_host is None) == (self.ft_fields is None):
            raise SettingsError(
                "the scene has a force/torque sensor under the base: expected either its address (ft_host) "
                f"or six RTDE fields (ft_fields), got {'both' if self.ft_host else 'neither'}; set "
                "base_wrench: null in the scene to run without it"
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
            constant_readings=self.constant_readings,
        )
        try:
            # A trial without the base sensor, whose client would begin to work at once.
            LiveSource(scene.model_copy(update={"base_wrench": None}), settings).close()
        except SensorError as error:
            raise SettingsError(str(error)) from None
        return partial(LiveSource, settings=settings)
