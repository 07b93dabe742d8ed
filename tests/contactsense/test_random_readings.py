"""Whatever a scene and its readings are: estimates are finite, probabilities are such, no memory is lost."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.contactsense.random_readings import try_out


@pytest.mark.slow
def test_estimates_of_random_readings_are_finite() -> None:
    contacts = [try_out(seed) for seed in range(12)]
    assert max(contacts) > 1  # or hardly anything is tested


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_no_kernel_reads_or_writes_beyond_its_arrays(tmp_path: Path) -> None:
    """Kernels do not check indices; with these checks they are compiled anew, which takes minutes."""
    checked = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-W", "error", "-m", "tests.contactsense.random_readings", "--scenes", "150"]
    done = subprocess.run(command, env=checked, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
