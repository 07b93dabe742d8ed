"""The ports for robot programs: XML-RPC and the line socket, in the service's event loop."""

import asyncio
import logging
import socket
import sys
from collections.abc import Callable

from contactsense.service.controllers.http_calls import HttpError, HttpReader, HttpRequest, http_response
from contactsense.service.controllers.line_protocol import LineError, LineReader, reply
from contactsense.service.controllers.robot_program import BAD_REQUEST, RobotProgramMethods
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.controllers.xmlrpc import XmlRpcError, parse_call, response
from contactsense.service.free_ports import PortError, Wanted, check, reason

XMLRPC, LINE = "--xmlrpc-port", "--line-port"
"""Options that name the ports."""
INTERFACES = {XMLRPC: "XML-RPC", LINE: "line socket"}
"""What is at these ports."""
PREFIX = "contactsense_"
"""Prefix of the method names over XML-RPC."""
XML = "text/xml"
"""Content type of calls and answers."""
PATHS = (b"/RPC2", b"/")
"""Paths to which calls are posted."""
_HEAD_TIME = 10.0
"""Longest time for a request to become complete [s]."""
_KEEP_ALIVE = (30, 10)
"""Silence of a client after which the system asks whether it is still there, and time between the three
questions [s]."""
_log = logging.getLogger("contactsense")


def answer_call(methods: RobotProgramMethods, body: bytes) -> bytes:
    """The answer to an XML-RPC call: always an array of numbers."""
    try:
        name, arguments = parse_call(body)
    except XmlRpcError as error:
        _log.info("XML-RPC: %s", error)
        return response([BAD_REQUEST])
    return response(methods.call(name.removeprefix(PREFIX), arguments))


def _notice_silent_end(connection: socket.socket) -> None:
    """Let the system ask whether the other end is still there. A controller that is switched off says
    nothing, and its connections would count until no further one is taken."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    idle = "TCP_KEEPALIVE" if sys.platform == "darwin" else "TCP_KEEPIDLE"
    for option, value in ((idle, _KEEP_ALIVE[0]), ("TCP_KEEPINTVL", _KEEP_ALIVE[1]), ("TCP_KEEPCNT", 3)):
        if hasattr(socket, option):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


class _Connection(asyncio.Protocol):
    """Common part of both ports: limits on the number of connections and on the clients' addresses."""

    transport: asyncio.Transport

    def __init__(self, servers: "RobotProgramServers", methods: RobotProgramMethods) -> None:
        self._servers, self._methods = servers, methods
        self._open: set[_Connection] = servers.connections.setdefault(type(self), set())
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Refuse addresses that the settings do not list, and connections beyond the limit."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        peer = transport.get_extra_info("peername")
        settings = self._servers.settings
        refusal = ""
        if peer is None or not settings.may_connect(peer[0]):
            refusal = "it is not one of --controller-clients"
        elif len(self._open) >= settings.connections:
            refusal = f"{settings.connections} are open already"
        if refusal:
            _log.warning("a robot program's connection from %s is refused: %s", peer and peer[0], refusal)
            transport.abort()
            return
        connection = transport.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        _notice_silent_end(connection)
        # Do not wait for a program that does not read its answers.
        transport.set_write_buffer_limits(high=65_536)
        self._open.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the connection and its timer."""
        self._open.discard(self)
        self.wait_for(False)

    def pause_writing(self) -> None:
        """The program does not read its answers."""
        _log.warning("a robot program does not read its answers: its connection is closed")
        self.transport.abort()

    def wait_for(self, begun: bool) -> None:
        """Set the timer if a request has begun, which must be complete in time; otherwise cancel it."""
        if self._timer is not None and not begun:
            self._timer.cancel()
            self._timer = None
        elif self._timer is None and begun:
            self._timer = asyncio.get_running_loop().call_later(_HEAD_TIME, self.transport.abort)


class XmlRpcConnection(_Connection):
    """One client of XML-RPC."""

    def __init__(self, servers: "RobotProgramServers", methods: RobotProgramMethods) -> None:
        super().__init__(servers, methods)
        self._reader = HttpReader()

    def data_received(self, data: bytes) -> None:
        """Answer the complete calls."""
        if self.transport.is_closing():
            return
        try:
            requests = self._reader.feed(data)
        except HttpError as error:
            self._refuse(error.status, error.reason)
            return
        for request in requests:
            self._answer(request)
        if self._reader.take_continue():
            self.transport.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        self.wait_for(self._reader.begun)

    def _answer(self, request: HttpRequest) -> None:
        if request.method != b"POST":
            self._refuse("405 Method Not Allowed", "expected POST")
        elif request.target.split(b"?")[0] not in PATHS:
            self._refuse("404 Not Found", "expected /RPC2")
        elif not self.transport.is_closing():
            body = answer_call(self._methods, request.body)
            self.transport.write(http_response(body, XML, request.keep_alive))
            if not request.keep_alive:
                self.transport.close()

    def _refuse(self, status: str, reason: str) -> None:
        if not self.transport.is_closing():
            self.transport.write(http_response(f"{reason}\n".encode(), "text/plain", False, status))
            self.transport.close()


class LineConnection(_Connection):
    """One client of the line socket."""

    def __init__(self, servers: "RobotProgramServers", methods: RobotProgramMethods) -> None:
        super().__init__(servers, methods)
        self._reader = LineReader()

    def data_received(self, data: bytes) -> None:
        """Answer the complete lines."""
        for request in self._reader.feed(data):
            if self.transport.is_closing():
                return
            numbers = [BAD_REQUEST] if isinstance(request, LineError) else self._methods.call(*request)
            self.transport.write(reply(numbers))


class RobotProgramServers:
    """Opens and closes the ports.

    Args:
        settings: Ports, and addresses that may connect.
        methods: The methods that answer requests.
    """

    def __init__(self, settings: ControllerSettings, methods: RobotProgramMethods) -> None:
        self.settings = settings
        self.connections: dict[type, set[_Connection]] = {}
        """Open connections by kind."""
        self.addresses: dict[str, tuple[str, int]] = {}
        """Option of each open port -> host and port."""
        self._methods = methods
        self._servers: list[asyncio.Server] = []

    async def start(self) -> None:
        """Open the ports.

        Raises:
            PortError: A port cannot be opened.
        """
        made: dict[str, Callable[[], asyncio.Protocol]] = {
            XMLRPC: lambda: XmlRpcConnection(self, self._methods),
            LINE: lambda: LineConnection(self, self._methods),
        }
        for wanted in self._wanted():
            await self._open(wanted, made[wanted.option])

    def check(self) -> None:
        """Check that both ports can be open at the same time, before the service starts.

        Raises:
            PortError: A port cannot be opened.
        """
        check(self.settings.host, self._wanted())

    def _wanted(self) -> tuple[Wanted, ...]:
        ports = ((XMLRPC, self.settings.xmlrpc_port), (LINE, self.settings.line_port))
        return tuple(Wanted(option, port) for option, port in ports if port is not None)

    async def stop(self) -> None:
        """Close the ports and their connections."""
        for server in self._servers:
            server.close()
        for connections in self.connections.values():
            for connection in tuple(connections):
                connection.transport.abort()
        self._servers.clear()
        self.addresses.clear()

    async def _open(self, wanted: Wanted, make: Callable[[], asyncio.Protocol]) -> None:
        host, option = self.settings.host, wanted.option
        try:
            server = await asyncio.get_running_loop().create_server(make, host, wanted.port)
        except OSError as error:
            await self.stop()
            raise PortError(f"{option}: cannot listen at {host}:{wanted.port}: {reason(error)}") from None
        self._servers.append(server)
        self.addresses[option] = server.sockets[0].getsockname()[:2]
        _log.info("robot programs: %s at %s:%d", INTERFACES[option], *self.addresses[option])
