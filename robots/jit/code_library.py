"""How LLVM turns kernels into machine code: each is optimized once, and only those that Python calls become
machine code.

Numba optimizes every function twice, alone and with the functions that it calls linked in, and makes machine
code of it each time. Of a few hundred kernels Python calls ten. All others are linked into these, where they
are optimized with what surrounds them, so that machine code of their own is never run.
"""

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

_ENVIRONMENT = "_ZN08NumbaEnv"
"""Prefix of the global variables that Numba sets when a function is compiled or loaded."""


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel, optimized only after the kernels that it calls are linked in."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Numba calls this before the kernels that this one calls are linked in."""
        ll_module.data_layout = self._codegen._data_layout


class LinkedLibrary(KernelLibrary):
    """The code of a kernel that only kernels call. It is linked into these, and is no machine code itself."""

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


class KernelCompiler(Compiler):
    """Numba's compiler with a `KernelLibrary`."""

    library: type[KernelLibrary] = KernelLibrary

    def compile_extra(self, func: Any) -> Any:
        """Compile a function; Numba calls this once for each set of argument types."""
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
        return super().compile_extra(func)  # type: ignore[no-untyped-call]


class LinkedCompiler(KernelCompiler):
    """Numba's compiler with a `LinkedLibrary`."""

    library = LinkedLibrary
