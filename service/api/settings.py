"""Settings of the service: from the command line, or from environment variables for `uvicorn --factory`."""

import contextlib
import os
from collections.abc import Callable, Mapping
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

from contactsense.robots.files.field_errors import Place, joined
from contactsense.scene import describe
from contactsense.service.api.http.access import host_names, page_origins
from contactsense.service.api.http.token_file import check_token
from contactsense.service.api.variables import from_json, read_variables
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.events.journal import JournalSettings
from contactsense.service.logs import Format, Level
from contactsense.service.reactions.state import ReactionSettings
from contactsense.service.recordings.writing.clip_listener import RecordingSettings
from contactsense.service.sensors.clients import netft_client as netft
from contactsense.service.sensors.clients import rtde_client as rtde
from contactsense.service.sensors.network_wrench import WrenchSource


class SettingsError(ValueError):
    """A setting cannot be used; the message names it, what was expected and what was given."""


class OptionsError(SettingsError):
    """The settings themselves are wrong, or do not go together, whatever is in the files that they name."""


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


Port = Annotated[int, Field(ge=0, le=65535)]
Counts = Annotated[tuple[PositiveFloat, PositiveFloat], BeforeValidator(_counts)]
Names = Annotated[tuple[str, ...], BeforeValidator(_split)]
Fields = Annotated[tuple[str, ...], BeforeValidator(_six_names), Field(min_length=6, max_length=6)]


class LinkWrenchSettings(BaseModel):
    """Where the readings of a force/torque sensor within the arm come from."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    host: str | None = None
    """Address of a Net F/T sensor."""
    port: Port = netft.DEFAULT_PORT
    """RDT port of the sensor (UDP)."""
    http_port: Port = netft.DEFAULT_HTTP_PORT
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

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

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
    robot_port: Port = rtde.DEFAULT_PORT
    """RTDE port of the robot's controller."""
    robot_client: Literal["rtde", "ur_rtde"] = "rtde"
    """Client that reads the robot: the built-in one, which loses no samples, or ur_rtde in its own
    process."""
    robot_rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 500.0
    """Robot samples per second [Hz]: 500 for e-Series, 125 for CB3."""
    ft_host: str | None = None
    """Address of the force/torque sensor under the base (Net F/T)."""
    ft_port: Port = netft.DEFAULT_PORT
    """RDT port of the sensor (UDP)."""
    ft_http_port: Port = netft.DEFAULT_HTTP_PORT
    """Port of the sensor's configuration page."""
    ft_counts: Counts | None = None
    """The sensor's counts per N and per Nm, instead of reading the configuration page."""
    ft_rate: PositiveFloat | None = None
    """The sensor's samples per second [Hz]; None: estimated from the arrivals, which takes longer on a busy
    computer."""
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
    token: Annotated[str, AfterValidator(check_token)] | None = None
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
    """Clips and recordings, see `contactsense.service.recordings.writing.clip_listener`."""
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
        try:
            return cls.checked(given, "environment", spelled)
        except OptionsError as error:
            raise SettingsError(str(error)) from None

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
            OptionsError: A value cannot be used.
        """
        try:
            return cls.model_validate(dict(values))
        except ValidationError as error:
            raise OptionsError(f"{name}: {describe(error, cls, spelled)}") from None
