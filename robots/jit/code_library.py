"""How LLVM turns kernels into machine code: each is optimized once, and only those that Python calls become
machine code.

Numba optimizes every function twice, alone and with the functions that it calls linked in, and makes machine
code of it each time. Of a few hundred kernels Python calls ten. All others are linked into these, where they
are optimized with what surrounds them, so that machine code of their own is never run.

There they are private, which Numba leaves out. LLVM may then change how they are called: an array is passed
as seven numbers and more, of which most functions use two. A search takes a quarter less time.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.typed_passes import NopythonTypeInference

from contactsense.robots.jit.nonnegative_indices import NonnegativeIndices

_ENVIRONMENT = "_ZN08NumbaEnv"
"""Prefix of the global variables that Numba sets when a function is compiled or loaded."""
_NEW_OBJECTS = 100_000
"""Number of new objects after which a compilation looks for garbage."""

_LARGE = 1000
"""Number of arguments above which a function takes the whole `Constants` or `State`; an array is seven."""


@contextmanager
def _rare_garbage_collection() -> Iterator[None]:
    """Look for garbage only when there are many new objects: a compilation makes millions that stay, and to
    look through them again and again takes up to a tenth of its time."""
    thresholds = gc.get_threshold()
    # A threshold of zero: no collection at all.
    gc.set_threshold(max(thresholds[0], _NEW_OBJECTS) if thresholds[0] else 0, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def _takes_large_structures(code: Any) -> bool:
    """Whether a function in a module takes structures of hundreds of arrays."""
    defined = (function for function in code.functions if not function.is_declaration)
    return any(sum(1 for _ in function.arguments) > _LARGE for function in defined)


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel, optimized only after the kernels that it calls are linked in."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Numba calls this before the kernels that this one calls are linked in."""
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Numba calls this after the kernels that this one calls are linked in."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                # An internal one would keep its name, by which other code with this kernel would find it, and
                # call it in the usual way.
                function.linkage = "private"
        self._run_passes()

    def _run_passes(self, **options: Any) -> None:
        """Optimize the code, with these options of LLVM's pass builder."""
        passes, builder = self._codegen._module_pass_manager(**options)  # type: ignore[no-untyped-call]
        passes.run(self._final_module, builder)


class LinkedLibrary(KernelLibrary):
    """The code of a kernel that only kernels call. It is linked into these, and is no machine code itself."""

    def _optimize_final_module(self) -> None:
        """A little, so that there is less to link; all passes run when it is linked."""
        if _takes_large_structures(self._final_module):
            passes = llvm.create_new_module_pass_manager()
            passes.add_always_inliner_pass()
            # Before `sroa`: it reads the fields that are used instead of whole structures, of which `sroa`
            # makes a value per field and use. Loops that become SIMD code need the usual order.
            passes.add_instruction_combine_pass()
            passes.add_sroa_pass()
            passes.add_simplify_cfg_pass()
            builder = self._codegen._pass_builder()  # type: ignore[no-untyped-call]
            passes.run(self._final_module, builder)
        else:
            self._run_passes(cost="cheap", opt=1, loop_vectorize=False, slp_vectorize=False)

    def _finalize_final_module(self) -> None:
        """Numba calls this when the code is optimized, to make machine code of it."""
        code = self._final_module
        declared = self._codegen._create_empty_module(self.name)  # type: ignore[no-untyped-call]
        for function in code.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._shared_module = code
        # Numba sets these variables in memory, so that they must exist.
        for variable in code.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                environment = ir.GlobalVariable(declared, ir.IntType(8).as_pointer(), variable.name)
                environment.linkage = "common"
                environment.initializer = ir.Constant(environment.value_type, None)
        self._final_module = llvm.parse_assembly(str(declared))
        self._final_module.name = declared.name
        super()._finalize_final_module()  # type: ignore[no-untyped-call]


class KernelFlags(Flags):
    """Numba's compile options, which it compares for each operator in each kernel: with all their defaults
    that takes a twentieth of the time."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, KernelFlags) and self._values == other._values

    def __hash__(self) -> int:
        return hash(frozenset(self._values))


class KernelCompiler(Compiler):
    """Numba's compiler with a `KernelLibrary`."""

    library: type[KernelLibrary] = KernelLibrary

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[no-untyped-call]
        self.state.flags = KernelFlags(self.state.flags)  # type: ignore[no-untyped-call]

    def define_pipelines(self) -> list[Any]:
        """Numba's pipeline, with one pass more."""
        (pipeline,) = super().define_pipelines()  # type: ignore[no-untyped-call]
        pipeline.add_pass_after(NonnegativeIndices, NopythonTypeInference)
        pipeline.finalize()
        return [pipeline]

    def compile_extra(self, func: Any) -> Any:
        """Compile a function; Numba calls this once for each set of argument types."""
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
        with _rare_garbage_collection():
            return super().compile_extra(func)  # type: ignore[no-untyped-call]


class LinkedCompiler(KernelCompiler):
    """Numba's compiler with a `LinkedLibrary`."""

    library = LinkedLibrary
