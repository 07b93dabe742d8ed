"""The order of the test files, as on a fresh machine `make test` spends most of its time compiling; and who
shares the machine."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.machine import machine

FIRST = "contactsense/test_localizer.py"
"""Compiles nearly all that the others use."""
WITHOUT = (
    "robots",
    "contactsense/solvers",
    "contactsense/calibration",
    "golden",
    "kinematics",
    "service/mock",
    "service/sensors",
    "service/wire",
)
"""Folders whose tests locate no contact and use kernels of their own."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """One worker compiles the localizer while another works on what can do without it; side by side on the
    files that need it, both would compile the same kernels.

    Where groups are told apart (`--dist loadgroup`), a file's tests go to one worker, which makes their
    fixtures once. All that measures in real time comes last and goes to one worker: live services that two
    workers keep for their files take the processor from each other even while no other test runs.
    """
    root = Path(__file__).parent

    def turn(item: pytest.Item) -> int:
        name = item.path.relative_to(root).as_posix()
        if name == FIRST:
            return 0
        if _is_realtime(item):
            return 3
        return 1 if name.startswith(WITHOUT) else 2

    items.sort(key=turn)
    for item in items:
        name = "realtime" if _is_realtime(item) else item.path.relative_to(root).as_posix()
        item.add_marker(pytest.mark.xdist_group(name))


def _is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


@pytest.fixture(autouse=True)
def _machine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A test that is marked `realtime` runs while no other does."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # the workers' common folder
    with machine(folder, alone=_is_realtime(request.node)):
        yield
