"""Compile times of all kernels that a localizer needs: `robots/jit/compile_times.yaml`, from which the
progress of the first compilation is estimated.

`python -m contactsense.benchmarks.live.compile_times` compiles everything again, without using the cache, and
writes the table. Only the ratios of processor times count, so any machine can be used.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import contactsense.robots.jit

TABLE = Path(contactsense.robots.jit.__path__[0]) / "compile_times.yaml"
_SHORTEST = 0.01
"""Shorter compile times are rounded up to this [s]."""


def measure() -> dict[str, list[float]]:
    """Compile in this process, without the existing cache; compile time of each version of each function
    [s]."""
    from contactsense import Localizer, Scene
    from contactsense.robots.jit.compilation import Compilation
    from contactsense.stream_localizer import kernels_of

    scene = Scene(robot="ur5e", contacts=3)
    with Compilation(kernels_of(scene), clock=time.process_time) as compilation:
        Localizer(scene, progress=False)
    table: dict[str, list[float]] = {}
    for name, seconds in compilation.times:
        if not name.startswith("numba."):
            table.setdefault(name, []).append(max(round(seconds, 2), _SHORTEST))
    return table


def main() -> None:
    """Measure in a process whose cache is empty, and write the table."""
    if "--measure" in sys.argv[1:]:
        if hasattr(os, "sched_setaffinity"):
            # With a second processor, another process would take part, whose times are not seen here.
            os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        rows = "".join(f"{name}: {times}\n" for name, times in sorted(measure().items()))
        TABLE.write_text(
            "# Time to compile each version of a function [s], without the functions that it calls. Written\n"
            "# by `python -m contactsense.benchmarks.live.compile_times`.\n" + rows,
            encoding="utf-8",
        )
        return
    with tempfile.TemporaryDirectory() as cache:
        subprocess.run(
            [sys.executable, "-m", "contactsense.benchmarks.live.compile_times", "--measure"],
            env={**os.environ, "NUMBA_CACHE_DIR": cache},
            check=True,
        )


if __name__ == "__main__":
    main()
