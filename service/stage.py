"""The whole play on this host: the service and a mock arm, each in a process of its own, on free ports."""

import socket
import time
from contextlib import ExitStack
from types import TracebackType

from service.children import Child, ChildError, child
from service.cli.mock import READY as MOCK_READY
from service.cli.serve import READY as SERVE_READY
from service.client import Client

LOADING = 900.0
"""Time in which the kernels must have been compiled [s]."""


class Stage:
    """Service and mock arm for as long as the context lasts.

    The service comes first and waits for its robot, as it would for a real one: then no sample of the arm's
    is missed because the kernels were still being compiled.
    """

    def __init__(self, robot: str, port: int = 0) -> None:
        """A stage for that robot, the service at `port`; 0 takes a free one."""
        self._robot = robot
        self._port = port
        self._rtde, self._page = _free_port(), _free_port()
        self._ft = _free_port(socket.SOCK_DGRAM)
        self._stack = ExitStack()

    def start_service(self) -> Client:
        """Start the service and wait until it has loaded; a client that has subscribed to its stream.

        Raises:
            ChildError: It does not come up.
        """
        service = self._stack.enter_context(
            child(
                "serve",
                *("--robot", self._robot, "--robot-host", "127.0.0.1", "--robot-port", str(self._rtde)),
                *("--ft-host", "127.0.0.1", "--ft-port", str(self._ft), "--ft-http-port", str(self._page)),
                *("--port", str(self._port)),
            )
        )
        client = self._stack.enter_context(Client(service.wait_for(SERVE_READY)))
        _until_loaded(service, client)
        return client

    def start_arm(self, *more: str) -> None:
        """Start the mock arm, with further arguments to `contactsense mock`.

        Raises:
            ChildError: It does not come up.
        """
        arm = self._stack.enter_context(
            child(
                "mock",
                *(
                    "--rtde-port",
                    str(self._rtde),
                    "--ft-port",
                    str(self._ft),
                    "--ft-http-port",
                    str(self._page),
                ),
                *more,
            )
        )
        arm.wait_for(MOCK_READY)

    def __enter__(self) -> "Stage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def _until_loaded(service: Child, client: Client) -> None:
    deadline = time.monotonic() + LOADING
    while True:
        service.check()
        health = client.health()
        if health.status == "failing":
            raise ChildError(health.message)
        if health.status != "starting":
            return
        if time.monotonic() > deadline:
            raise ChildError(f"the service is still starting after {LOADING:g} s")
        time.sleep(0.1)


def _free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
