"""Locates static samples in a separate process, so that neither loading kernels nor a request with ten
thousand samples delays the stream."""

import asyncio
import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, NamedTuple

import numpy as np

from contactsense import Localizer, Scene
from contactsense.service.live.estimate_json import estimate_json

Numbers = Sequence[float]

MAX_REQUESTS = 32
"""Maximum number of requests at a time: the one that is being answered, and those that wait."""
_NICE = 5
"""Nice value: static samples have lower priority than the processes of the stream."""
_FIRST = 600.0
"""Time limit for the first answer, before which kernels may have to be compiled [s]."""
_LATER = 60.0
"""Time limit for each further answer [s]."""


class StaticSample(NamedTuple):
    """Readings of an arm at rest."""

    q: Numbers
    base_wrench: Numbers | None
    joint_torque: Numbers | None
    wrist_wrench: Numbers | None
    link_wrenches: Mapping[str, Numbers] | None = None


Request = tuple[list[StaticSample], bool, int]
"""Samples, whether the arm's weight is subtracted, and the largest number of simultaneous contacts."""


class LocateError(Exception):
    """The request cannot be answered at present; the text gives the reason."""


class LocateProcess:
    """Answers requests one after another; restarted if it dies. Used from one event loop."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None
        self._answered = False
        self._turn = asyncio.Lock()
        self._requests = 0
        self._lock = threading.Lock()
        self._closed = False

    async def locate(self, samples: Sequence[StaticSample], external: bool, contacts: int = 1) -> list[bytes]:
        """Return an estimate as JSON for each sample.

        Args:
            samples, external, contacts: As for `Localizer.locate`; at most the contacts of the scene.

        Raises:
            LocateError: Too many requests wait already, or the process failed.
        """
        if self._requests >= MAX_REQUESTS:
            raise LocateError(
                f"{MAX_REQUESTS} requests are being answered or waiting already; try again later"
            )
        self._requests += 1
        # A request that is cancelled keeps its turn until its answer has come: the next one would read it.
        task = asyncio.ensure_future(self._locate_in_turn((list(samples), external, contacts)))
        task.add_done_callback(_look_at_error)
        return await asyncio.shield(task)

    async def _locate_in_turn(self, request: Request) -> list[bytes]:
        try:
            async with self._turn:
                return await asyncio.to_thread(self._ask, request)
        finally:
            self._requests -= 1

    async def start(self) -> None:
        """Start the process, which loads its kernels immediately."""
        await asyncio.shield(self._start_in_turn())

    async def _start_in_turn(self) -> None:
        async with self._turn:
            await asyncio.to_thread(self._started)

    def restart(self, scene: Scene) -> None:
        """Restart with another scene; a request in progress fails."""
        self._scene = scene
        self._end()

    def stop(self) -> None:
        """Kill the process, even while it computes."""
        self._closed = True
        self._end()

    def _started(self) -> Connection:
        with self._lock:
            if self._closed:
                raise LocateError("the service ends")
            if self._connection is not None:
                return self._connection
            context = multiprocessing.get_context("spawn")
            connection, theirs = context.Pipe()
            process = context.Process(target=work, args=(theirs,), name="contactsense locate", daemon=True)
            try:
                process.start()
            except BaseException:
                connection.close()
                raise
            finally:
                theirs.close()
            self._connection, self._process, scene = connection, process, self._scene
            self._answered = False
        # No argument of the process, see `contactsense.service.process_argument`, and without the lock: a
        # large scene waits until the process has loaded its modules, and it may be killed before that. The
        # next request notices.
        with self._limited(_FIRST), contextlib.suppress(OSError):
            connection.send(scene)
        return connection

    @contextlib.contextmanager
    def _limited(self, seconds: float) -> Iterator[None]:
        """Kill the process after this time [s]. That ends `recv`, and `send` too, which waits as long as a
        process that hangs does not empty the pipe.

        Raises:
            LocateError: The time is over.
        """
        over = threading.Event()

        def give_up() -> None:
            over.set()
            self._end()

        timer = threading.Timer(seconds, give_up)
        timer.daemon = True
        timer.start()
        try:
            yield
        except (OSError, EOFError) as error:
            if not over.is_set():
                raise
            raise LocateError(
                "no answer in time; the process that locates contacts is being restarted"
            ) from error
        finally:
            timer.cancel()

    def _ask(self, request: Request) -> list[bytes]:
        try:
            connection = self._started()
            with self._limited(_LATER if self._answered else _FIRST):
                connection.send(request)
                answer: Any = connection.recv()
        except (OSError, EOFError) as error:
            self._end()
            raise LocateError("the process that locates contacts failed and is being restarted") from error
        self._answered = True
        if isinstance(answer, str):
            raise LocateError(answer)
        found: list[bytes] = answer
        return found

    def _end(self) -> None:
        with self._lock:
            process = self._process
            # The connection is closed as soon as no thread uses it any more.
            self._process = self._connection = None
        if process is not None:
            process.kill()  # clients can repeat a request in progress
            process.join()
            process.close()


def _look_at_error(task: asyncio.Task[list[bytes]]) -> None:
    """Nobody else looks where the request has been cancelled, and asyncio would log that as an error."""
    if not task.cancelled():
        task.exception()


def work(connection: Connection) -> None:
    """Main function of the process, which first receives the scene. Returns when the service has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        os.nice(_NICE)
    with contextlib.suppress(EOFError, OSError):
        localizer = Localizer(connection.recv())
        while True:
            samples, external, contacts = connection.recv()
            try:
                connection.send([_located(localizer, sample, external, contacts) for sample in samples])
            except ValueError as error:
                connection.send(f"{type(error).__name__}: {error}")


def _located(localizer: Localizer, sample: StaticSample, external: bool, contacts: int) -> bytes:
    estimate = localizer.locate(
        np.array(sample.q),
        base_wrench=_array(sample.base_wrench),
        joint_torque=_array(sample.joint_torque),
        wrist_wrench=_array(sample.wrist_wrench),
        link_wrenches={name: np.array(value) for name, value in (sample.link_wrenches or {}).items()},
        external=external,
        contacts=contacts,
    )
    return estimate_json(estimate)


def _array(values: Numbers | None) -> np.ndarray | None:
    return None if values is None else np.array(values)
