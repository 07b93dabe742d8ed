"""Tasks on worker processes that may die: the task of a dead worker is assigned to another one.

`run_tasks` is the only interface: it runs one process, several on this machine, or a Dask cluster.
"""

import gc
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Generator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from contactsense.robots.extras import install_command
from contactsense.service.group_signals import ignored

MOST_DEATHS = 3
"""A task is abandoned after this many workers have died during it."""


class WorkerPoolError(RuntimeError):
    """The tasks cannot be run; the message says why."""


def run_tasks(
    function: Callable[[Any], Any], tasks: Sequence[Any], workers: int = 1, scheduler: str | None = None
) -> Generator[tuple[Any, Any], None, None]:
    """Results of `function(task)` as (task, result), in the order of completion.

    Args:
        function: Defined at the top level of a module, so that other processes can import it.
        tasks: Picklable arguments.
        workers: Processes on this machine; 1: this one.
        scheduler: Address of a Dask scheduler, which is used instead.

    The result of a failed task is an exception.

    Raises:
        WorkerPoolError: Dask is not installed or its scheduler does not answer.
    """
    if scheduler is not None:
        yield from _on_dask(function, tasks, scheduler)
    elif workers <= 1 or len(tasks) <= 1:
        for task in tasks:
            yield task, _outcome(function, task)
    else:
        yield from _on_processes(function, tasks, min(workers, len(tasks)))


def _outcome(function: Callable[[Any], Any], task: Any) -> Any:
    """The result, or the exception that was raised."""
    try:
        return function(task)
    except Exception as error:
        return error


class _Worker:
    """One process and its current task."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, function), daemon=True)
        # In a terminal Ctrl-C reaches all processes, and the main one ends the others.
        with ignored(signal.SIGINT):
            self.process.start()
        other.close()
        self.task: int | None = None

    def give(self, number: int, task: Any) -> bool:
        """Send a task; False if the worker is gone."""
        try:
            self.pipe.send(task)
        except OSError:
            return False
        self.task = number
        return True

    def stop(self) -> None:
        """Terminate the process."""
        self.pipe.close()
        self.process.terminate()
        self.process.join()


def _serve(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """Main loop of a worker process."""
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(_outcome(function, task))


def _on_processes(
    function: Callable[[Any], Any], tasks: Sequence[Any], count: int
) -> Generator[tuple[Any, Any], None, None]:
    waiting, deaths = deque(range(len(tasks))), [0] * len(tasks)
    workers: list[_Worker] = []
    try:
        # Within the block: an interrupt may come while they are started.
        workers.extend(_Worker(function) for _ in range(count))
        while True:
            for i in range(count):
                while workers[i].task is None and waiting:
                    if workers[i].give(waiting[0], tasks[waiting[0]]):
                        waiting.popleft()
                    else:
                        workers[i].stop()
                        workers[i] = _Worker(function)
            busy = {worker.pipe: i for i, worker in enumerate(workers) if worker.task is not None}
            if not busy:
                return
            for pipe in wait(list(busy)):
                i = busy[pipe]  # type: ignore[index]
                number = workers[i].task
                assert number is not None
                try:
                    result = workers[i].pipe.recv()
                except (EOFError, OSError):
                    workers[i].stop()
                    workers[i] = _Worker(function)
                    deaths[number] += 1
                    if deaths[number] < MOST_DEATHS:
                        waiting.append(number)
                        continue
                    result = WorkerPoolError(f"{MOST_DEATHS} worker processes died over this task")
                workers[i].task = None
                yield tasks[number], result
    finally:
        for worker in workers:
            worker.stop()


def _on_dask(
    function: Callable[[Any], Any], tasks: Sequence[Any], scheduler: str
) -> Generator[tuple[Any, Any], None, None]:
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise WorkerPoolError(f"--scheduler needs Dask: {install_command('fleet')}") from None
    client, reason = None, ""
    try:
        client = Client(scheduler, timeout=10)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TimeoutError) as error:
        reason = str(error)
    if client is None:
        # What is left of it stops its event loop when it is collected. While another one starts, each would
        # wait for the other for good.
        gc.collect()
        raise WorkerPoolError(f"--scheduler: {scheduler!r}: cannot reach it: {reason}")
    with client:
        futures = {client.submit(function, task, pure=False, retries=MOST_DEATHS): task for task in tasks}
        for future in as_completed(list(futures)):  # type: ignore[no-untyped-call]
            failure = future.exception()
            yield futures[future], future.result() if failure is None else failure
