"""A compiler pass: kernels count the items of an array from its start.

In Python `a[i]` with a negative i counts from the end, so that Numba compares each index with zero, and adds
the array's length where it is less. No kernel means that by an index that it computes, and the comparisons
take a twelfth of a batch's time. A constant, as in `a[-1]`, still counts from the end.
"""

from collections.abc import Iterator
from typing import Any

from numba.core import ir, types
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import GuardException, find_build_sequence, find_const


@register_pass(mutates_CFG=False, analysis_only=False)  # type: ignore[no-untyped-call]
class NonnegativeIndices(FunctionPass):
    """Makes the computed indices of arrays unsigned, which Numba takes as they are."""

    _name = "nonnegative_indices"

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]

    def run_pass(self, state: Any) -> bool:
        """Numba calls this when types are known; returns whether anything changed."""
        changed = False
        for access in _accesses(state.func_ir):
            signature = state.calltypes[access]
            array, kind = signature.args[:2]
            new = _unsigned(state.func_ir, access.index, kind) if isinstance(array, types.Array) else kind
            if new != kind:
                # Numba's dictionary refuses another value for a key that it has.
                del state.calltypes[access]
                state.calltypes[access] = signature.replace(args=(array, new, *signature.args[2:]))
                changed = True
        return changed


def _accesses(func_ir: Any) -> Iterator[Any]:
    """The statements and expressions that write or read an item whose index is not a constant."""
    for block in func_ir.blocks.values():
        for statement in block.body:
            access = statement.value if isinstance(statement, ir.Assign) else statement
            if isinstance(access, ir.SetItem) or (isinstance(access, ir.Expr) and access.op == "getitem"):
                yield access


def _unsigned(func_ir: Any, index: Any, kind: Any) -> Any:
    """The type of an index, of this type now, with its integers unsigned but for negative constants."""
    kinds: Any = kind if isinstance(kind, types.BaseTuple) else ()
    if kinds:
        parts = _found(find_build_sequence, func_ir, index)
        if parts is None:
            return kind
        new = [_unsigned(func_ir, *part) for part in zip(parts[0], kinds, strict=True)]
        return types.BaseTuple.from_types(new)  # type: ignore[no-untyped-call]
    constant = _found(find_const, func_ir, index)
    negative = isinstance(constant, int) and constant < 0
    return kind if negative or not isinstance(kind, types.Integer) else types.uintp


def _found(find: Any, func_ir: Any, variable: Any) -> Any:
    """What one of Numba's functions finds out about a variable; None if nothing."""
    try:
        return find(func_ir, variable)
    except GuardException:
        return None
