"""Waiting for the end of a process, and ending it, without threads or files."""

import asyncio
from multiprocessing.process import BaseProcess

_PATIENCE = 2.0
"""Time that a process has to end by itself [s]."""
_INTERVAL = 0.02
"""Time between two looks at a process [s]."""


async def exit_code(process: BaseProcess) -> int | None:
    """Wait a moment for the exit code of a process; None if it has not ended by then."""
    deadline = asyncio.get_running_loop().time() + _PATIENCE
    while process.exitcode is None and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(_INTERVAL)
    return process.exitcode


async def ask_to_end(connection: asyncio.StreamWriter | None, receiving: asyncio.Task[str]) -> bool:
    """Tell a process to end, and take what it reports of that, such as files that it completes; returns
    whether it has ended in time.

    Args:
        connection: To the process, which ends when nothing more can come; None: there is none yet.
        receiving: Takes its messages until it has ended.
    """
    if connection is not None:
        connection.write_eof()
    await asyncio.wait({receiving}, timeout=_PATIENCE)
    return receiving.done()


async def end(process: BaseProcess, *, at_once: bool) -> None:
    """Wait for the end of a process that has been told to end, and kill it if it does not.

    Args:
        process: The process; nothing happens if it was never started.
        at_once: Kill it without waiting: it hangs.
    """
    if process.pid is None:
        return
    if not at_once:
        await exit_code(process)
    while process.exitcode is None:
        process.kill()
        await asyncio.sleep(_INTERVAL)
    process.close()
