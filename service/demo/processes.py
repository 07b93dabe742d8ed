"""The whole demonstration on this host: service and mock arm, each in its own process, on free ports."""

import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType

from contactsense.service.api import READY as SERVE_READY
from contactsense.service.api.client import Client
from contactsense.service.api.messages import HealthOut
from contactsense.service.demo.child_process import Child, ChildError, child
from contactsense.service.mock import READY as MOCK_READY

LOADING = 330.0
"""Time limit for the service to load, or to make progress with loading [s]."""


class Stage:
    """Service and mock arm, which run while the context is open.

    The service is started first and waits for its robot, as it would for a real one. Thus no sample is missed
    while the kernels are being compiled.
    """

    def __init__(self, robot: str, port: int = 0) -> None:
        """Prepare a stage for this robot, with the service at `port`; 0: any free port."""
        self._robot = robot
        self._port = port
        self._rtde, self._page = _free_port(), _free_port()
        self._ft = _free_port(socket.SOCK_DGRAM)
        self._secondary, self._dashboard = _free_port(), _free_port()
        self._stack = ExitStack()

    @property
    def rtde_port(self) -> int:
        """The mock arm's RTDE port."""
        return self._rtde

    @property
    def secondary_port(self) -> int:
        """The mock arm's secondary client interface."""
        return self._secondary

    @property
    def dashboard_port(self) -> int:
        """The mock arm's dashboard server."""
        return self._dashboard

    def start_service(
        self,
        *more: str,
        on_url: Callable[[str], object] = lambda url: None,
        on_health: Callable[[HealthOut], object] = lambda health: None,
    ) -> Client:
        """Start the service, with additional arguments to `contactsense serve`, and wait until it has loaded.
        Returns a client that has subscribed to its stream.

        Args:
            on_url: Called with the service's URL as soon as it answers, before it has loaded.
            on_health: Called with the service's health while it loads, ten times a second.

        Raises:
            ChildError: The process does not start.
        """
        service = self._stack.enter_context(
            child(
                "serve",
                *("--robot", self._robot, "--robot-host", "127.0.0.1", "--robot-port", str(self._rtde)),
                *("--ft-host", "127.0.0.1", "--ft-port", str(self._ft), "--ft-http-port", str(self._page)),
                *("--port", str(self._port)),
                *more,
                "--constant-readings",  # a script may be without noise
            )
        )
        url = service.wait_for(SERVE_READY)
        client = self._stack.enter_context(Client(url))
        on_url(url)
        _until_loaded(service, client, on_health)
        return client

    def start_arm(self, *more: str) -> Child:
        """Start the mock arm, with additional arguments to `contactsense mock`; returns its process.

        Raises:
            ChildError: The process does not start.
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
                    "--secondary-port",
                    str(self._secondary),
                    "--dashboard-port",
                    str(self._dashboard),
                ),
                *more,
            )
        )
        arm.wait_for(MOCK_READY)
        return arm

    def __enter__(self) -> "Stage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def _until_loaded(service: Child, client: Client, on_health: Callable[[HealthOut], object]) -> None:
    deadline, loading = time.monotonic() + LOADING, 0.0
    while True:
        service.check()
        health = client.health()
        on_health(health)
        if health.loading > loading:
            deadline, loading = time.monotonic() + LOADING, health.loading
        if health.status == "failing":
            raise ChildError(health.message)
        if health.status != "starting":
            return
        if time.monotonic() > deadline:
            raise ChildError(f"the service has made no progress loading for {LOADING:g} s: {health.message}")
        time.sleep(0.1)


def _free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
