"""Machine code of a kernel has no names for the kernels linked into it; compiling it leaves settings as they
were; Numba's options are told apart, and functions of large structures."""

import gc
import re
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba.core.cpu_options import FastMathOptions

from contactsense import Localizer, Sample, Scene
from contactsense.robots.jit.code_library import (
    KernelFlags,
    _rare_garbage_collection,
    _takes_large_structures,
)
from contactsense.runtime.kernels import process


def test_kernels_within_another_have_no_names() -> None:
    """Code compiled elsewhere, with one of them in it too, would find it by its name and call it as it is
    called there. It is called differently: with fewer arguments, in other registers."""
    joints = np.zeros(6)
    Localizer(Scene(robot="ur5e")).step(Sample(t=0.0, q=joints, qd=joints, base_wrench=joints))
    files = Path(process._cache.cache_path).glob("kernels.process-*.nbc")
    # LLVM's own form of the code, for other kernels, follows that for the processor.
    code = max(files, key=lambda file: file.stat().st_mtime).read_bytes()
    machine_code = code.partition(b"\x7fELF")[2].partition(b"BC\xc0\xde")[0]
    names = re.findall(rb"_ZN[0-9A-Za-z_$.]+", machine_code)
    assert any(b"process" in name for name in names)
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


def test_options_are_equal_if_all_that_are_set_are() -> None:
    flags = KernelFlags()
    flags.fastmath = FastMathOptions({"contract"})
    copy = flags.copy()
    assert copy == flags
    assert hash(copy) == hash(flags)
    copy.fastmath = FastMathOptions(False)
    assert copy != flags


@pytest.mark.parametrize(("arguments", "large"), [(1000, False), (1001, True)])
def test_functions_of_large_structures_are_those_with_many_arguments(arguments: int, large: bool) -> None:
    def module(body: str) -> llvm.ModuleRef:
        return llvm.parse_assembly(f"{body.format(', '.join(['double'] * arguments))}")

    assert _takes_large_structures(module("define void @f({}) {{ ret void }}")) == large
    assert not _takes_large_structures(module("declare void @f({})"))
