"""Settings of the service: from the command line, or from environment variables for `uvicorn --factory`."""

import contextlib
import ipaddress
import os
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationError,
)

from contactsense.robots.field_errors import Place, joined
from contactsense.scene import Scene, SceneError, describe
from contactsense.service.api.access import AccessRules, host_names, page_origins
from contactsense.service.api.variables import PREFIX, from_json, read_variables
from contactsense.service.controllers.push_source import PushSource
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.events.journal import JournalSettings
from contactsense.service.live.listener import Listener
from contactsense.service.logs import Format, Level
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import ReactionSettings
from contactsense.service.recordings.clip_listener import ClipListener, RecordingSettings
from contactsense.service.scene.skin_meshes import check_meshes
from contactsense.service.sensors.live_source import LiveSource, SourceSettings
from contactsense.service.sensors.network_wrench import WrenchSource
from contactsense.service.sensors.robot_stream import SensorError
from contactsense.service.wire.rtde_fields import JOINTS

READERS = (
    "ft_host", "ft_fields", "ft_port", "ft_http_port", "ft_counts", "robot_port", "robot_client",
    "wrist_fields", "link_wrenches", "constant_readings",
)  # fmt: skip
"""Settings of how the robot and its sensors are read: without effect where the service reads no robot."""
_REACTIONS_TOO = ("robot_host", "robot_port")
"""Settings by which reactions find the robot, unless their rules have its address."""
_VARIABLES = ("wrist_fields", "link_wrenches")
"""Those of them that have no option."""


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a service at that address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class SettingsError(ValueError):
    """A setting cannot be used; the message names it, what was expected and what was given."""


def _split(value: Any) -> Any:
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


def _counts(value: Any) -> Any:
    """Split the text of an option or variable; values of other types are left to Pydantic."""
    if not isinstance(value, str):
        return value
    with contextlib.suppress(ValueError):
        numbers = tuple(float(part) for part in value.split(","))
        if len(numbers) == 2 and min(numbers) > 0.0:
            return numbers
    raise ValueError(f"expected two numbers, counts per N and per Nm, such as 1000000,1000000, got {value!r}")


def _six_names(value: Any) -> Any:
    """The same for six fields."""
    names = _split(value)
    if isinstance(value, str) and (len(names) != 6 or not all(names)):
        raise ValueError(f"expected six names of RTDE fields, separated by commas, got {value!r}")
    return names


def _option(name: str) -> str:
    """How the user writes a setting of the readers."""
    return PREFIX + name.upper() if name in _VARIABLES else f"--{name.replace('_', '-')}"


Port = Annotated[int, Field(ge=0, le=65535)]
Counts = Annotated[tuple[PositiveFloat, PositiveFloat], BeforeValidator(_counts)]
Names = Annotated[tuple[str, ...], BeforeValidator(_split)]
Fields = Annotated[tuple[str, ...], BeforeValidator(_six_names), Field(min_length=6, max_length=6)]


class LinkWrenchSettings(BaseModel):
    """Where the readings of a force/torque sensor within the arm come from."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    host: str | None = None
    """Address of a Net F/T sensor."""
    port: Port = 49152
    """RDT port of the sensor (UDP)."""
    http_port: Port = 80
    """Port of the sensor's configuration page."""
    counts: Counts | None = None
    """The sensor's counts per N and per Nm, instead of reading the configuration page."""
    fields: Names = ()
    """RTDE fields with the sensor's reading [N, Nm], instead of `host`: one field of six numbers, or six
    fields of one number."""

    @property
    def source(self) -> WrenchSource:
        """The same for the reader."""
        return WrenchSource(self.host, self.port, self.http_port, self.counts, self.fields)


class Settings(BaseModel):
    """Settings of the service. Without `robot_host` it reads no sensors and only answers POST /v1/locate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scene: Path | None = None
    """Scene file; None: `robot` on a table, with default sensors."""
    robot: str = "ur5e"
    """Robot to assume if there is no scene file."""
    host: str = "127.0.0.1"
    """Address to serve at."""
    port: Port = 8000
    """Port to serve at; 0: any free port."""
    robot_host: str | None = None
    """Address of the robot's controller."""
    robot_port: Port = 30004
    """RTDE port of the robot's controller."""
    robot_client: Literal["rtde", "ur_rtde"] = "rtde"
    """Client that reads the robot: the built-in one, which loses no samples, or ur_rtde in its own
    process."""
    robot_rate: PositiveFloat = 500.0
    """Robot samples per second [Hz]: 500 for e-Series, 125 for CB3."""
    ft_host: str | None = None
    """Address of the force/torque sensor under the base (Net F/T)."""
    ft_port: Port = 49152
    """RDT port of the sensor (UDP)."""
    ft_http_port: Port = 80
    """Port of the sensor's configuration page."""
    ft_counts: Counts | None = None
    """The sensor's counts per N and per Nm, instead of reading the configuration page."""
    ft_fields: Fields | None = None
    """Six RTDE fields with the base sensor's reading [N, Nm], instead of `ft_host`."""
    wrist_fields: Names = ("ft_raw_wrench",)
    """RTDE fields with the wrist sensor's reading [N, Nm], if the scene has such a sensor: one field of six
    numbers, or six fields of one number."""
    link_wrenches: Annotated[dict[str, LinkWrenchSettings], BeforeValidator(from_json)] = {}
    """Sources of the scene's further force/torque sensors within the arm, by name: `host`, `port`,
    `http_port`, `counts` of a Net F/T sensor, or `fields`, RTDE fields with its reading [N, Nm]."""
    constant_readings: bool = False
    """Whether readings may be constant, like those of a simulator without noise; otherwise a signal that
    never changes counts as frozen and is ignored."""
    token: Annotated[str, Field(min_length=16)] | None = None
    """Token that every request must send as Authorization: Bearer; preferably set in the environment."""
    token_file: Path | None = None
    """File with the token, instead of `token`."""
    tls_certificate: Path | None = None
    """File with the certificate chain for TLS (PEM)."""
    tls_key: Path | None = None
    """File with the private key for TLS (PEM)."""
    insecure_no_tls: bool = False
    """Whether to serve other computers without TLS."""
    allowed_hosts: Annotated[Names, AfterValidator(host_names)] = ()
    """Host names under which the service is reached, in addition to localhost and IP addresses."""
    allowed_origins: Annotated[Names, AfterValidator(page_origins)] = ()
    """Origins of web pages, in addition to the service's own, that may use it, such as
    https://panel.example."""
    max_connections: PositiveInt = 200
    """Largest number of open connections, WebSockets included."""
    max_body: PositiveInt = 8_000_000
    """Largest body of a request [bytes]."""
    max_request_rate: PositiveFloat = 500.0
    """Largest number of requests per second from one address."""
    reader_timeout: PositiveFloat = 10.0
    """A client that reads nothing for this time is disconnected [s]."""
    log_level: Level = "info"
    """Lowest level of logged messages."""
    log_format: Format = "text"
    """Format of the log: text for people, or JSON."""
    log_file: Path | None = None
    """File to log to instead of stderr; rotated at 10 MB, five files are kept."""
    queue: PositiveInt = 500
    """Estimates kept for a slow reader of the stream before it loses the oldest."""
    events: Annotated[JournalSettings, BeforeValidator(from_json)] = JournalSettings()
    """Where events are stored, and how many. As JSON in an environment variable."""
    reactions: Annotated[ReactionSettings, BeforeValidator(from_json)] = ReactionSettings()
    """Where the rules of reactions are. As JSON in an environment variable."""
    recording: Annotated[RecordingSettings, BeforeValidator(from_json)] = RecordingSettings()
    """Clips and recordings, see `contactsense.service.recordings.clip_listener`."""
    controllers: Annotated[ControllerSettings, BeforeValidator(from_json)] = ControllerSettings()
    """Interfaces for controllers. As JSON in an environment variable."""

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> "Settings":
        """Create settings from `CONTACTSENSE_*` variables: those of the settings, and of options that are
        fields of a group. Other variables with that prefix are ignored, see `misspelled`.

        Raises:
            SettingsError: A value cannot be used.
        """
        given, spelled = read_variables(environment, cls.model_fields)
        return cls.checked(given, "environment", spelled)

    @classmethod
    def checked(
        cls,
        values: Mapping[str, object],
        name: str = "settings",
        spelled: Callable[[Place], str] = joined,
    ) -> "Settings":
        """Validate values and create settings.

        Args:
            values: By name of the setting.
            name: Their source, for error messages.
            spelled: How the user writes a setting.

        Raises:
            SettingsError: A value cannot be used.
        """
        try:
            return cls.model_validate(dict(values))
        except ValidationError as error:
            raise SettingsError(f"{name}: {describe(error, cls, spelled)}") from None

    def access_rules(self) -> AccessRules:
        """Return the rules of access.

        Raises:
            SettingsError: The token file cannot be read or contains no token.
        """
        token = self.token
        if self.token_file is not None:
            try:
                token = self.token_file.read_text().strip()
            except (OSError, UnicodeDecodeError) as error:
                raise SettingsError(
                    f"--token-file: {self.token_file} cannot be read: {getattr(error, 'strerror', error)}"
                ) from None
            if len(token) < 16:
                raise SettingsError(
                    f"--token-file: expected a token of at least 16 characters in {self.token_file}, "
                    f"got {len(token)}"
                )
        hosts = (*self.allowed_hosts, self.host) if self.host else self.allowed_hosts
        return AccessRules(token, hosts, self.allowed_origins)

    def check_exposure(self) -> None:
        """Check that the service is not exposed to other computers by accident without a token or without
        TLS.

        Raises:
            SettingsError: The token or TLS is missing; the message states which.
        """
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise SettingsError("expected both --tls-certificate and --tls-key, or neither, got one")
        if is_loopback(self.host):
            return
        if self.access_rules().token is None:
            raise SettingsError(
                f"--host {self.host} is reached by other computers: expected a token (CONTACTSENSE_TOKEN or "
                "--token-file), got none"
            )
        if self.tls_certificate is None and not self.insecure_no_tls:
            raise SettingsError(
                f"--host {self.host} is reached by other computers: expected --tls-certificate and "
                "--tls-key, or --insecure-no-tls for a network that you trust, got neither"
            )

    def load_scene(self) -> Scene:
        """Load the scene.

        Raises:
            SettingsError: The scene file cannot be used or has another robot, or there is no such robot.
        """
        try:
            if self.scene is None:
                return Scene.model_validate({"robot": self.robot})
            scene = Scene.load(self.scene)
        except SceneError as error:
            raise SettingsError(str(error)) from None
        except ValidationError as error:
            raise SettingsError(describe(error, Scene)) from None
        except LookupError as error:
            raise SettingsError(str(error.args[0] if error.args else error)) from None
        try:
            check_meshes(scene)
        except SceneError as error:
            raise SettingsError(f"{self.scene}: {error}") from None
        own = scene.robot
        same = own.name == self.robot or (own.file or Path()).resolve() == Path(self.robot).resolve()
        if "robot" in self.model_fields_set and not same:
            raise SettingsError(
                f"--robot: expected {own.name}, the robot of {self.scene}, or no --robot, got {self.robot!r}"
            )
        return scene

    def unused(self, scene: Scene) -> tuple[str, ...]:
        """Settings that have no effect with this scene, one readable line each."""
        given = self.ft_host is not None or self.ft_fields is not None
        if scene.base_wrench is None and given and self.controllers.source == "robot":
            option = "--ft-host" if self.ft_host is not None else "--ft-fields"
            return (f"{option} is not used: the scene has no base_wrench",)
        return ()

    def check_robot_address(self, rules: ReactionRules | None) -> None:
        """Check that the robot's address is of use: where a controller sends the samples, only reactions
        connect to the robot, and their rules may have its address.

        Args:
            rules: The rules; None if there are none.

        Raises:
            SettingsError: It is without effect.
        """
        given = [name for name in _REACTIONS_TOO if name in self.model_fields_set]
        if self.controllers.source != "push" or not given:
            return
        if rules is None:
            why = "there are no rules"
        elif rules.robot.host is not None:
            why = f"the rules have the robot's address, {rules.robot.host}"
        elif self.robot_host is None:
            why = "there is no --robot-host"
        else:
            return
        raise SettingsError(
            f"{_option(given[0])} is for reactions only with --source push, where the controller sends the "
            f"samples: expected none, as {why}"
        )

    def listeners(self) -> tuple[Callable[[Scene], Listener], ...]:
        """Factories of the pipeline's listeners, picklable.

        Raises:
            SettingsError: The folder for recordings cannot be written to.
        """
        folder = self.recording.folder
        if folder is None:
            return ()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise SettingsError(
                f"--recordings: {folder}: expected a folder that can be written to, got: {error.strerror}"
            ) from None
        return (partial(ClipListener, settings=self.recording, rate=self.robot_rate),)

    def open_source(self, scene: Scene) -> Callable[[Scene], LiveSource | PushSource] | None:
        """Return a picklable factory of the source of samples; None if no robot is configured.

        Raises:
            SettingsError: The scene requires a signal that these settings do not provide.
        """
        readers = [name for name in READERS if name in self.model_fields_set]
        if self.controllers.source == "push":
            readers = [name for name in readers if name not in _REACTIONS_TOO]
            if readers:
                raise SettingsError(
                    f"{_option(readers[0])} is for samples that are read from the robot: expected it without "
                    "--source push, where the controller sends them"
                )
            return partial(PushSource, path=self.controllers.socket_path)
        if self.robot_host is None:
            if readers:
                raise SettingsError(
                    f"{_option(readers[0])} is read together with the robot: "
                    "expected --robot-host too, got none"
                )
            return None
        if len(scene.robot.joints) != JOINTS:
            raise SettingsError(
                f"--robot-host: expected an arm with {JOINTS} joints, as RTDE has them, got "
                f"{scene.robot.name} with {len(scene.robot.joints)}; its controller can send its samples "
                "itself: --source push"
            )
        if scene.base_wrench is not None and (self.ft_host is None) == (self.ft_fields is None):
            raise SettingsError(
                "the scene has a force/torque sensor under the base: expected either its address "
                "(--ft-host) or six RTDE fields (--ft-fields), got "
                f"{'both' if self.ft_host else 'neither'}; set base_wrench: null in the scene to run without "
                "it"
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
            link_wrenches={name: source.source for name, source in self.link_wrenches.items()},
            constant_readings=self.constant_readings,
        )
        try:
            # Try without sensors on the network, because their clients would connect at once.
            remote = {name for name, source in settings.link_wrenches.items() if source.host is not None}
            local = tuple(sensor for sensor in scene.link_wrenches if sensor.name not in remote)
            tried = scene.model_copy(update={"base_wrench": None, "link_wrenches": local})
            LiveSource(tried, settings).close()
        except SensorError as error:
            raise SettingsError(str(error)) from None
        return partial(LiveSource, settings=settings)
