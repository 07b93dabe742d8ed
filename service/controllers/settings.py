"""How controllers may come in."""

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
    model_validator,
)

Port = Annotated[int, Field(ge=0, le=65535)]


def _split(value: Any) -> Any:
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


class ControllerSettings(BaseModel):
    """Interfaces for controllers. Robot programs can neither encrypt nor send a token; hence their ports are
    on the loopback interface unless `host` says otherwise, and then only for the addresses in `clients`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: Literal["robot", "push"] = "robot"
    """Where the pipeline's samples come from: read from the robot, or pushed over WS /v1/track."""
    tracks: PositiveInt = 4
    """Most connections of WS /v1/track at a time, each with a process of its own."""
    idle: PositiveFloat = 300.0
    """A connection of WS /v1/track that sends nothing for so long is closed [s]."""
    host: str = "127.0.0.1"
    """Address of the ports for robot programs."""
    clients: Annotated[tuple[str, ...], BeforeValidator(_split)] = ()
    """Addresses of robots that may connect to them; needed beyond the loopback interface."""
    xmlrpc_port: Port | None = None
    """Port for XML-RPC; 0 takes a free one, None: only at POST /RPC2 of the service."""
    line_port: Port | None = None
    """Port of the line socket; 0 takes a free one, None: no line socket."""
    connections: PositiveInt = 16
    """Most connections at a time on each of the two ports."""

    @model_validator(mode="after")
    def _is_closed(self) -> Self:
        for name, addresses in (("host", (self.host,)), ("clients", self.clients)):
            for address in addresses:
                try:
                    ipaddress.ip_address(address)
                except ValueError:
                    raise ValueError(f"{name}: expected an IP address, got {address!r}") from None
        opened = self.xmlrpc_port is not None or self.line_port is not None
        if opened and not ipaddress.ip_address(self.host).is_loopback and not self.clients:
            raise ValueError(
                f"clients: expected the addresses of the robots that may connect at {self.host}, got none"
            )
        if self.source == "push" and os.name == "nt":
            raise ValueError("source: push needs Unix sockets, which this system does not have")
        return self

    @cached_property
    def socket_path(self) -> Path:
        """Unix socket by which pushed samples reach the pipeline, in a folder that only we can enter."""
        folder = tempfile.mkdtemp(prefix="contactsense-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        return Path(folder) / "push"

    def may_connect(self, address: str) -> bool:
        """Whether a robot program may connect from this address."""
        if self.clients:
            return address in self.clients
        return ipaddress.ip_address(address).is_loopback
