"""Declared arrays (`contactsense.robots.jit.declaration`) in two flat buffers: passing a hundred arrays to a
compiled function takes longer than its computation.

One buffer holds floats and records, the other one integers, in the order in which the fields are declared.
The integers begin with the sizes: Python passes a number as slowly as an array. The place of each field in
its buffer follows: were it the sum of the sizes of all fields before it, LLVM would take seconds to simplify
such sums of a hundred products in every loop.
"""

import functools
import itertools
import math
from collections.abc import Mapping
from types import CodeType
from typing import Any, TypeVar

import numpy as np

from contactsense.robots.jit.array_views import records, view
from contactsense.robots.jit.declaration import WORD, Leaf, Node, fields_of
from contactsense.robots.jit.kernel import generated_kernel

D = TypeVar("D")


def zeros(kind: type[D], **sizes: int) -> D:
    """Zero-filled arrays of a declaration. Numbers that are passed by value are zero as well.

    Raises:
        NameError: A size is missing.
    """

    def fill(part: Node | Leaf) -> Any:
        if isinstance(part, Node):
            return part.kind(*map(fill, part.fields))
        return 0.0 if part.by_value else np.zeros(_shape(part, sizes), part.dtype)

    made: D = fill(fields_of(kind))
    return made


class FlatBuffers:
    """The two buffers and the arrays in them."""

    def __init__(self, values: tuple[Any, ...], sizes: Mapping[str, int]) -> None:
        """Copy declared arrays into new buffers.

        Args:
            values: NamedTuples whose types are declared.
            sizes: The sizes that the declarations name, in the order of `views_kernel`.

        Raises:
            ValueError: An array does not have the declared shape.
        """
        leaves = [leaf for value in values for leaf in _leaves(fields_of(type(value)), value)]
        floats = [np.zeros(0)]
        integers = [np.array([*sizes.values(), *(0 for _ in leaves)], dtype=np.int64)]
        for leaf, array in leaves:
            if np.shape(array) != _shape(leaf, sizes):
                raise ValueError(f"{leaf.name}: expected shape {_shape(leaf, sizes)}, got {np.shape(array)}")
            words = np.ascontiguousarray(array, dtype=leaf.dtype).ravel()
            if leaf.dtype == np.int64:
                integers.append(words)
            else:
                floats.append(words.view(np.float64))
        self.floats = np.concatenate(floats)
        self.integers = np.concatenate(integers)
        self._field, self._float, self._integer = len(sizes), 0, len(sizes) + len(leaves)
        self.views = tuple(self._view(fields_of(type(value)), sizes) for value in values)
        """The same declarations; their arrays are parts of the buffers."""

    def _view(self, part: Node | Leaf, sizes: Mapping[str, int]) -> Any:
        if isinstance(part, Node):
            return part.kind(*(self._view(field, sizes) for field in part.fields))
        shape, field = _shape(part, sizes), self._field
        self._field += 1
        if part.dtype == np.int64:
            first, self._integer = self._integer, self._integer + math.prod(shape)
            self.integers[field] = first
            return self.integers[first : self._integer].reshape(shape)
        words = math.prod(shape) * part.dtype.itemsize // WORD
        first, self._float = self._float, self._float + words
        self.integers[field] = first
        if part.by_value:
            return float(self.floats[first])
        return self.floats[first : self._float].view(part.dtype).reshape(shape)


def views_kernel(name: str, kinds: tuple[type, ...], sizes: tuple[str, ...], module: str) -> Any:
    """A kernel, inlined into others, that finds declared arrays in flat buffers.

    Its argument is a tuple of `FlatBuffers.floats` and `FlatBuffers.integers`. It returns the declarations as
    a tuple. It is generated, as Numba cannot loop over fields of different types.

    Args:
        name: Name of the kernel.
        kinds: The declarations, in the order in which they lie in the buffers.
        sizes: Names of the sizes, in order.
        module: Name of the module that holds the kernel.
    """
    lines = [
        f"def {name}(buffers):",
        "    floats, integers = buffers",
        *(f"    {size} = integers[{i}]" for i, size in enumerate(sizes)),
    ]
    names: dict[str, Any] = {"view": view, "records": records}
    fields = itertools.count(len(sizes))

    def value(part: Node | Leaf) -> str:
        if isinstance(part, Node):
            names[part.kind.__name__] = part.kind
            return f"{part.kind.__name__}({', '.join([value(field) for field in part.fields])})"
        field, shape = next(fields), f"({', '.join(part.shape)},)"
        if part.by_value:
            return f"floats[integers[{field}]]"
        if part.dtype == np.int64:
            return f"view(integers, integers[{field}], {shape})"
        if part.dtype == np.float64:
            return f"view(floats, integers[{field}], {shape})"
        names[f"dtype{field}"] = part.dtype
        lines.append(f"    x{field} = records(floats, integers[{field}], {shape}, dtype{field})")
        # The comment makes the layout a part of the source, whose change invalidates the cache.
        lines[-1] += f"  # {part.dtype}"
        return f"x{field}"

    values = [value(fields_of(kind)) for kind in kinds]
    return generated_kernel(name, "\n".join([*lines, f"    return {', '.join(values)}", ""]), names, module)


def _leaves(part: Node | Leaf, value: Any) -> list[tuple[Leaf, Any]]:
    if isinstance(part, Leaf):
        return [(part, value)]
    return [leaf for field, inner in zip(part.fields, value, strict=True) for leaf in _leaves(field, inner)]


def _shape(leaf: Leaf, sizes: Mapping[str, int]) -> tuple[int, ...]:
    return tuple(int(eval(_code(axis), {"max": max, "min": min}, dict(sizes))) for axis in leaf.shape)


@functools.cache
def _code(expression: str) -> CodeType:
    return compile(expression, "<shape>", "eval")
