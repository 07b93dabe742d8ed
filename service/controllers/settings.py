"""Settings of the interfaces for controllers."""

import atexit
import ipaddress
import os
import shutil
import tempfile
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

Port = Annotated[int, Field(ge=0, le=65535)]


def _split(value: Any) -> Any:
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


def _address(text: str) -> str:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        raise ValueError(f"expected an IP address, got {text!r}") from None
    return text


class ControllerSettings(BaseModel):
    """Interfaces for controllers. Robot programs can neither encrypt nor send a token. Therefore their ports
    are on the loopback interface unless `host` is set; then only the addresses in `clients` may connect."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    source: Literal["robot", "push"] = "robot"
    """Source of the pipeline's samples: read from the robot, or pushed over WS /v1/track."""
    tracks: PositiveInt = 4
    """Largest number of simultaneous connections of WS /v1/track, each with its own process."""
    idle: PositiveFloat = 300.0
    """A connection of WS /v1/track that sends nothing for this time is closed [s]."""
    host: str = "127.0.0.1"
    """Address of the ports for robot programs."""
    clients: Annotated[tuple[str, ...], BeforeValidator(_split)] = ()
    """Addresses of robots that may connect to these ports; required beyond the loopback interface."""
    xmlrpc_port: Port | None = None
    """Port for XML-RPC; 0: any free port; None: only POST /RPC2 of the service."""
    line_port: Port | None = None
    """Port of the line socket; 0: any free port; None: no line socket."""
    connections: PositiveInt = 16
    """Largest number of simultaneous connections on each of the two ports."""

    @field_validator("host")
    @classmethod
    def _is_an_address(cls, host: str) -> str:
        return _address(host)

    @field_validator("clients")
    @classmethod
    def _are_addresses(cls, clients: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_address(client) for client in clients)

    @model_validator(mode="after")
    def _is_closed(self) -> Self:
        opened = self.xmlrpc_port is not None or self.line_port is not None
        if opened and not ipaddress.ip_address(self.host).is_loopback and not self.clients:
            raise ValueError(
                f"at {self.host}, other computers reach the ports for robot programs: expected the addresses "
                "of the robots that may connect (--controller-clients), got none"
            )
        if self.source == "push" and os.name == "nt":
            raise ValueError("source: push needs Unix sockets, which this system does not have")
        return self

    @cached_property
    def socket_path(self) -> Path:
        """Unix socket for pushed samples to the pipeline, in a folder that only this user can access."""
        folder = tempfile.mkdtemp(prefix="contactsense-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        return Path(folder) / "push"

    def may_connect(self, address: str) -> bool:
        """Whether a robot program may connect from this address."""
        if self.clients:
            return address in self.clients
        return ipaddress.ip_address(address).is_loopback
