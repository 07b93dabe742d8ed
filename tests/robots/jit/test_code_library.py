"""Machine code of a kernel has no names for the kernels linked into it; compiling it leaves settings as they
were."""

import gc
import re
from pathlib import Path

import numpy as np
import pytest

from contactsense import Localizer, Sample, Scene
from contactsense.robots.jit.code_library import _rare_garbage_collection
from contactsense.runtime.kernels import detect


def test_kernels_within_another_have_no_names() -> None:
    """Code compiled elsewhere, with one of them in it too, would find it by its name and call it as it is
    called there. It is called differently: with fewer arguments, in other registers."""
    joints = np.zeros(6)
    Localizer(Scene(robot="ur5e")).step(Sample(t=0.0, q=joints, qd=joints, base_wrench=joints))
    files = Path(detect._cache.cache_path).glob("kernels.detect-*.nbc")
    # LLVM's own form of the code, for other kernels, follows that for the processor.
    code = max(files, key=lambda file: file.stat().st_mtime).read_bytes()
    machine_code = code.partition(b"\x7fELF")[2].partition(b"BC\xc0\xde")[0]
    names = re.findall(rb"_ZN[0-9A-Za-z_$.]+", machine_code)
    assert any(b"detect" in name for name in names)
    # Variables of Numba's are shared by name; code is not.
    shared = [name for name in names if b"called_by_kernels" in name]
    assert [name for name in shared if not name.startswith(b"_ZN08NumbaEnv")] == []


def test_garbage_is_collected_as_before_after_a_compilation_even_a_failed_one() -> None:
    before = gc.get_threshold()

    def failing_compilation() -> None:
        with _rare_garbage_collection():
            assert gc.get_threshold()[0] > before[0]
            raise TypeError

    with pytest.raises(TypeError):
        failing_compilation()
    assert gc.get_threshold() == before
