"""The order of the test files, as on a fresh machine `make test` spends most of its time compiling; who
shares the machine; and what keeps chance out of the results."""

import gc
import os
from collections.abc import Generator, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import anyio
import pytest
from hypothesis import HealthCheck, settings

from tests.machine import STARVED, StolenTime, machine, wait_for_processor

# The same examples each time, however long the computer takes for one: none fails by chance.
settings.register_profile(
    "reproducible", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("reproducible")

# pytest parses the modules of anyio, which is one of its plugins, and the parser of Python 3.11 fails now and
# then where two threads parse at once. So a server thread must not be the first to use a part of it.
for part in ("from_thread", "lowlevel", "to_thread", "_backends._asyncio"):
    import_module(f"anyio.{part}")
for part in dir(anyio):
    getattr(anyio, part)

ATTEMPTS = 3
"""How often a test in real time is tried on a computer whose processors are taken away."""
PATIENCE = 60.0
"""How long it waits for them before it is tried again [s]."""

FIRST = (
    "contactsense/test_localizer.py",
    "contactsense/link_sensors/test_link_sensors.py",
    "contactsense/localization/test_intrinsic_contact.py",
    "contactsense/runtime/test_blocks.py",
    "benchmarks/multi_contact/test_command.py",
)
"""Compile nearly all that the others use."""
WITHOUT = (
    "robots",
    "contactsense/solvers",
    "contactsense/calibration",
    "contactsense/setup_check",
    "golden",
    "kinematics",
    "service/mock",
    "service/sensors",
    "service/wire",
)
"""Folders whose tests locate no contact and use kernels of their own."""
TOGETHER = ("contactsense/multi_contact", "service/analysis")
"""Folders whose tests share kernels of their own, which two workers would both compile. They take long and
come before the others, so that no worker has one left when the rest are done."""
LONGEST = (
    "service/test_calibrate.py",
    "service/live/test_supervisor.py",
    "service/test_commands.py",
    "service/test_geometry_commands.py",
    "service/viewer/test_playback_in_browser.py",
    "service/viewer/test_truth_in_browser.py",
    "benchmarks/posterior/test_posterior.py",
)
"""Files that take longest, and come before the others for the same reason."""
LIVE = {
    *("serving", "MockServers", "LiveServers", "NetFtServer", "RtdeServer", "Stage", "rtde_server"),
    "in_own_process",
}
"""A test file that imports one of these keeps simulated devices, or services that listen to them."""


@pytest.hookimpl(wrapper=True, optionalhook=True)  # of pytest-xdist
def pytest_xdist_auto_num_workers() -> Generator[None, int, int]:
    """One more than there are processors: that with the live services mostly waits."""
    return (yield) + 1


@pytest.hookimpl(tryfirst=True)  # before the groups are read
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """One worker compiles the localizer while others work on what can do without it; side by side on the
    files that need it, all would compile the same kernels.

    A file's tests go to one worker, which makes their fixtures once, as do those of some folders. All live
    services go to one worker, as two at a time would take the processor from each other; those that measure
    in real time come last.
    """

    def turn(item: pytest.Item) -> int:
        name = _name(item.path)
        if name in FIRST:
            return 0
        if _is_realtime(item):
            return 5
        if _is_live(item):
            return 1
        if name.startswith(WITHOUT):
            return 2
        return 3 if name.startswith((*TOGETHER, *LONGEST)) else 4

    items.sort(key=turn)
    for item in items:
        if item.get_closest_marker("long") is not None:
            item.add_marker("slow")
        group = _name(item.path)
        if group in FIRST:
            group = "first"
        elif _is_realtime(item) or _is_live(item):
            group = "realtime" if _is_realtime(item) else "live"
        else:
            group = next((folder for folder in TOGETHER if group.startswith(folder)), group)
        item.add_marker(pytest.mark.xdist_group(group))


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """A test in real time that fails is repeated if the host took the processors away meanwhile: the
    simulated arm is late then as well, and nothing can be told of the code. Where that goes on, the test is
    skipped."""
    if not _is_realtime(pyfuncitem):
        return None
    arguments = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    shares = []
    while True:
        stolen = StolenTime()
        try:
            pyfuncitem.obj(**arguments)
        except Exception:
            shares.append(stolen.share)
            if shares[-1] < STARVED:
                raise
        else:
            return True
        if len(shares) == ATTEMPTS:
            break
        wait_for_processor(PATIENCE)
    taken = ", ".join(f"{share:.0%}" for share in shares)
    pytest.skip(f"cannot be judged: the host took {taken} of the processors' time in {ATTEMPTS} attempts")


@cache  # thousands of tests are in hundreds of files
def _name(path: Path) -> str:
    """A file's name within this folder."""
    return path.relative_to(Path(__file__).parent).as_posix()


def _is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


def _is_live(item: pytest.Item) -> bool:
    return isinstance(item, pytest.Function) and not LIVE.isdisjoint(vars(item.module))


@pytest.fixture(scope="module", autouse=True)
def _no_collection_pauses(request: pytest.FixtureRequest) -> Iterator[None]:
    """Simulated devices run in this process, where a full collection takes 0.1 to 0.2 s: a burst on all their
    wires, which no device would cause. Objects that exist now are left out of it."""
    if LIVE.isdisjoint(vars(request.module)):
        yield
        return
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture(autouse=True)
def _machine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A test that is marked `realtime` runs while no other does."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # the workers' common folder
    with machine(folder, alone=_is_realtime(request.node)):
        yield
