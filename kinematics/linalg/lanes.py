"""Linear algebra of eight small systems at a time, one in each SIMD lane.

A vector of n unknowns is a flat array of n times `LANES` numbers, those of one unknown together; a matrix has
one such array for each row. The compiler does not vectorize loops over arrays that may overlap, so the
innermost operations are stated as vector instructions.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES

Rows = tuple[int, int]
"""Index of the first unknown, and how many unknowns later the next row begins."""


def add_dots(
    out: np.ndarray,
    at: Rows,
    a: np.ndarray,
    of: Rows,
    b: np.ndarray,
    k: int,
    rows: int,
    count: int,
    sign: float,
) -> None:
    """out[at[0] + t at[1]] += sign * sum over q < count of a[of[0] + t of[1] + q] b[k + q] for all t < rows.

    In all lanes, with indices of unknowns in arrays of one or two dimensions.
    """
    z, x, y = (part.reshape(-1, LANES) for part in (out, a, b))
    for t in range(rows):
        first = of[0] + t * of[1]
        z[at[0] + t * at[1]] += sign * (x[first : first + count] * y[k : k + count]).sum(axis=0)


def add_multiple(
    out: np.ndarray, o: int, a: np.ndarray, i: int, b: np.ndarray, k: int, count: int, sign: float
) -> None:
    """out[o + q] += sign * a[i + q] b[k] for all q < count; indices as above."""
    z, x, y = (part.reshape(-1, LANES) for part in (out, a, b))
    z[o : o + count] += sign * x[i : i + count] * y[k]


def multiply(out: np.ndarray, at: Rows, b: np.ndarray, k: int, rows: int) -> None:
    """out[at[0] + t at[1]] *= b[k] for all t < rows; indices as above."""
    z, y = (part.reshape(-1, LANES) for part in (out, b))
    for t in range(rows):
        z[at[0] + t * at[1]] *= y[k]


# If `strict`, Numba demands the same annotations of these, which take types, as of the functions that they
# return, which take values.
@overload(add_dots, strict=False)
def _add_dots(
    out: Any, at: Any, a: Any, of: Any, b: Any, k: Any, rows: Any, count: Any, sign: Any
) -> Callable[..., None]:
    return lambda out, at, a, of, b, k, rows, count, sign: _dots(  # type: ignore[call-arg]
        out, at, a, of, b, k, rows, count, sign
    )


@overload(add_multiple, strict=False)
def _add_multiple(
    out: Any, o: Any, a: Any, i: Any, b: Any, k: Any, count: Any, sign: Any
) -> Callable[..., None]:
    return lambda out, o, a, i, b, k, count, sign: _multiple(out, o, a, i, b, k, count, sign)  # type: ignore[call-arg]


@overload(multiply, strict=False)
def _multiply(out: Any, at: Any, b: Any, k: Any, rows: Any) -> Callable[..., None]:
    return lambda out, at, b, k, rows: _scale(out, at, b, k, rows)  # type: ignore[call-arg]


_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FAST = ("contract", "reassoc", "nsz")
_TOGETHER = 4
"""Sums that are computed at a time, so that none waits for the previous addition."""


def _pointer(target: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Pointer to the lanes of an unknown."""
    data = cgutils.create_struct_proxy(kind)(target, builder, value=array).data  # type: ignore[no-untyped-call]
    return builder.gep(builder.bitcast(data, _VECTOR.as_pointer()), [index])


def _load(builder: Any, pointer: Any, *indices: Any) -> Any:
    """The lanes there; arrays of numbers are aligned to 8 bytes."""
    value = builder.load(builder.gep(pointer, list(indices)) if indices else pointer)
    value.align = 8
    return value


def _store(builder: Any, value: Any, pointer: Any) -> None:
    builder.store(value, pointer).align = 8


def _splat(builder: Any, value: Any) -> Any:
    """A number in all lanes."""
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    vector = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        vector, nothing, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


def _rows_of_sums(
    builder: Any, together: int, first: Any, out: Any, a: Any, b: Any, count: Any, sign: Any
) -> None:
    """`together` sums; `out` and `a`: pointer and step of the rows, of which `first` is the first."""
    rows = [builder.add(first, ir.Constant(first.type, t)) for t in range(together)]
    starts = [builder.gep(a[0], [builder.mul(row, a[1])]) for row in rows]
    totals = [cgutils.alloca_once(builder, _VECTOR) for _ in rows]  # type: ignore[no-untyped-call]
    for total in totals:
        builder.store(ir.Constant(_VECTOR, [0.0] * LANES), total)
    with cgutils.for_range(builder, count) as loop:
        shared = _load(builder, b, loop.index)
        for start, total in zip(starts, totals, strict=True):
            product = builder.fmul(_load(builder, start, loop.index), shared, flags=_FAST)
            builder.store(builder.fadd(builder.load(total), product, flags=_FAST), total)
    for row, total in zip(rows, totals, strict=True):
        at = builder.gep(out[0], [builder.mul(row, out[1])])
        part = builder.fmul(sign, builder.load(total), flags=_FAST)
        _store(builder, builder.fadd(_load(builder, at), part, flags=_FAST), at)


@intrinsic
def _dots(
    context: Any, out: Any, at: Any, a: Any, of: Any, b: Any, k: Any, rows: Any, count: Any, sign: Any
) -> Any:
    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds, (out, at, a, of, b, k, rows, count, sign) = signature.args, arguments
        results, left = (
            (_pointer(target, builder, kind, array, first), step)
            for kind, array, (first, step) in (
                (kinds[0], out, cgutils.unpack_tuple(builder, at, 2)),  # type: ignore[no-untyped-call]
                (kinds[2], a, cgutils.unpack_tuple(builder, of, 2)),  # type: ignore[no-untyped-call]
            )
        )
        right, factor = _pointer(target, builder, kinds[4], b, k), _splat(builder, sign)
        none, one, together = (ir.Constant(rows.type, value) for value in (0, 1, _TOGETHER))
        whole = builder.mul(builder.sdiv(rows, together), together)
        for start, stop, step in ((none, whole, together), (whole, rows, one)):
            with cgutils.for_range_slice(builder, start, stop, step) as (row, _):
                _rows_of_sums(builder, step.constant, row, results, left, right, count, factor)
        return target.get_dummy_value()

    n = types.intp
    return types.void(out, at, a, of, b, n, n, n, types.float64), generate


@intrinsic
def _multiple(context: Any, out: Any, o: Any, a: Any, i: Any, b: Any, k: Any, count: Any, sign: Any) -> Any:
    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds, (out, o, a, i, b, k, count, sign) = signature.args, arguments
        at = _pointer(target, builder, kinds[0], out, o)
        x, y = _pointer(target, builder, kinds[2], a, i), _pointer(target, builder, kinds[4], b, k)
        factor = builder.fmul(_splat(builder, sign), _load(builder, y), flags=_FAST)
        with cgutils.for_range(builder, count) as loop:
            here = builder.gep(at, [loop.index])
            part = builder.fmul(_load(builder, x, loop.index), factor, flags=_FAST)
            _store(builder, builder.fadd(_load(builder, here), part, flags=_FAST), here)
        return target.get_dummy_value()

    n = types.intp
    return types.void(out, n, a, n, b, n, n, types.float64), generate


@intrinsic
def _scale(context: Any, out: Any, at: Any, b: Any, k: Any, rows: Any) -> Any:
    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds, (out, at, b, k, rows) = signature.args, arguments
        first, step = cgutils.unpack_tuple(builder, at, 2)  # type: ignore[no-untyped-call]
        start = _pointer(target, builder, kinds[0], out, first)
        factor = _load(builder, _pointer(target, builder, kinds[2], b, k))
        with cgutils.for_range(builder, rows) as loop:
            here = builder.gep(start, [builder.mul(loop.index, step)])
            _store(builder, builder.fmul(_load(builder, here), factor, flags=_FAST), here)
        return target.get_dummy_value()

    return types.void(out, at, b, types.intp, types.intp), generate


@fused_kernel
def clear(out: np.ndarray, start: int, count: int) -> None:
    """Set `count` unknowns from `start` on to zero."""
    for q in range(start * LANES, (start + count) * LANES):
        out[q] = 0.0


@fused_kernel
def cholesky_in_lanes(H: np.ndarray, size: int, pivots: np.ndarray, inverse: np.ndarray) -> None:
    """Cholesky factors in place of the lower triangles, but for the diagonals.

    Args:
        H: Matrices, shape (>= size, >= size * LANES).
        size: Number of unknowns.
        pivots: Filled: squares of the diagonals, not positive if a matrix is not positive definite,
            (>= size * LANES).
        inverse: Filled: the inverse diagonals, zero where a pivot is not positive.
    """
    step = H.shape[1] // LANES
    for j in range(size):
        row = j * step
        add_dots(H, (row + j, step), H, (row, step), H, row, size - j, j, -1.0)
        for q in range(j * LANES, (j + 1) * LANES):
            pivots[q] = H[j, q]
        for q in range(j * LANES, (j + 1) * LANES):
            inverse[q] = 1.0 / math.sqrt(pivots[q]) if pivots[q] > 0.0 else 0.0
        multiply(H, (row + step + j, step), inverse, j, size - j - 1)


@fused_kernel
def substitute(H: np.ndarray, size: int, inverse: np.ndarray, g: np.ndarray) -> None:
    """Solve L x = g in place of g, after `cholesky_in_lanes`."""
    step = H.shape[1] // LANES
    for i in range(size):
        add_dots(g, (i, 1), H, (i * step, 1), g, 0, 1, i, -1.0)
        multiply(g, (i, 1), inverse, i, 1)


@fused_kernel
def substitute_back(H: np.ndarray, size: int, inverse: np.ndarray, g: np.ndarray) -> None:
    """Solve L^T x = g in place of g."""
    step = H.shape[1] // LANES
    for i in range(size - 1, -1, -1):
        multiply(g, (i, 1), inverse, i, 1)
        add_multiple(g, 0, H, i * step, g, i, i, -1.0)
