"""How the arrays that kernels share are declared: each field once, with its type, shape, unit and meaning.

    @record
    class Clock:
        time: float
        "[s]"
        running: bool

    class Observer(NamedTuple):
        momentum: Annotated[Floats, "equations"]
        "At the last sample [Nms]."
        integrand: Annotated[Floats, "3, equations"]
        clock: Annotated[Records[Clock], "1"]

    class State(NamedTuple):
        joints: Annotated[Observer, Sized(equations="joints")]
        sensors: Annotated[Observer, Sized("sensors", equations="6")]
        "One of them per sensor: each array has a leading axis."

A shape is a list of integer expressions of named sizes.
`contactsense.robots.jit.flat_buffers` allocates what is declared, and finds it again in two flat buffers, in
Python and inside of kernels.
"""

import ast
import functools
from collections.abc import Hashable, Iterator, Mapping
from typing import (
    Annotated,
    Any,
    NamedTuple,
    Protocol,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

WORD = 8
"""Size of each number [bytes]."""
_SCALARS = {float: "f8", int: "i8", bool: "?"}
_DTYPES: dict[type, np.dtype[Any]] = {}
"""Types of the classes that `record` declares."""
C = TypeVar("C", bound=type)
R = TypeVar("R")


class Records(Protocol[R]):
    """An array of what `record` declares."""

    def __getitem__(self, index: int, /) -> R: ...

    def __setitem__(self, index: int, value: R, /) -> None: ...

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[R]: ...


class Sized:
    """Sizes of a nested declaration in terms of those of the declaration around it."""

    def __init__(self, *axes: str, **sizes: str) -> None:
        """Initialize.

        Args:
            axes: Leading axes that each of its arrays has in addition.
            sizes: Sizes that have other names outside.
        """
        self.axes = axes
        self.sizes = sizes


class Leaf(NamedTuple):
    """An array, or a number that is passed by value."""

    name: str
    """Name of the field and of the declaration around it."""
    dtype: np.dtype[Any]
    shape: tuple[str, ...]
    """Expressions of the sizes of the outermost declaration."""
    by_value: bool
    """Whether it is a number."""


class Node(NamedTuple):
    """A declaration and its fields in order."""

    kind: Any
    """The NamedTuple."""
    fields: tuple["Node | Leaf", ...]


def record(kind: C) -> C:
    """Declare named numbers of different types.

    An array of them is declared as `Annotated[Records[kind], shape]`. `array[0].name` reads and sets a
    number, in kernels and, slowly, in Python, where `numbers` is faster.

    Raises:
        TypeError: An annotation is not float, int or bool.
    """
    formats = {}
    for name, scalar in get_type_hints(kind).items():
        if scalar not in _SCALARS:
            raise TypeError(f"{kind.__name__}.{name}: expected float, int or bool, got {scalar!r}")
        formats[name] = _SCALARS[scalar]
    words: Any = {
        "names": list(formats),
        "formats": list(formats.values()),
        "offsets": [WORD * i for i in range(len(formats))],
        "itemsize": WORD * len(formats),
    }
    _DTYPES[kind] = np.dtype((np.record, np.dtype(words)))
    return kind


def numbers(records: Records[Any], name: str) -> np.ndarray:
    """One of the numbers of each record, as a view: a hundred times faster in Python than `record.name`."""
    return np.asarray(np.asarray(records)[name])


def fields_of(kind: Any) -> Node:
    """The fields of a NamedTuple whose annotations state shapes.

    Raises:
        TypeError: An annotation states none.
    """
    return _fields_of(kind)


@functools.cache
def _fields_of(kind: Hashable) -> Node:
    return _node(kind, {}, ())


def _node(kind: Any, sizes: Mapping[str, str], axes: tuple[str, ...]) -> Node:
    hints = get_type_hints(kind, include_extras=True)
    return Node(
        kind, tuple(_field(f"{kind.__name__}.{name}", hints[name], sizes, axes) for name in kind._fields)
    )


def _field(name: str, hint: Any, sizes: Mapping[str, str], axes: tuple[str, ...]) -> Node | Leaf:
    kind, note = get_args(hint)[:2] if get_origin(hint) is Annotated else (hint, None)
    if kind is float:
        return Leaf(name, np.dtype(np.float64), (), True)
    if hasattr(kind, "_fields"):
        sized = note if isinstance(note, Sized) else Sized()
        inner = {inside: _outer(text, sizes) for inside, text in sized.sizes.items()}
        return _node(kind, {**sizes, **inner}, axes + tuple(_outer(axis, sizes) for axis in sized.axes))
    dtype = _dtype(kind)
    if dtype is None or not isinstance(note, str):
        raise TypeError(
            f"{name}: expected float, a declaration, or Annotated[Floats, Integers or Records, "
            f"shape], got {hint!r}"
        )
    shape = ast.parse(f"({note},)", mode="eval").body
    assert isinstance(shape, ast.Tuple)
    return Leaf(name, dtype, axes + tuple(_outer(ast.unparse(axis), sizes) for axis in shape.elts), False)


def _dtype(kind: Any) -> np.dtype[Any] | None:
    if get_origin(kind) is Records:
        return _DTYPES.get(get_args(kind)[0])
    if kind == Floats:
        return np.dtype(np.float64)
    return np.dtype(np.int64) if kind == Integers else None


class _Substitution(ast.NodeTransformer):
    """Replaces names of sizes."""

    def __init__(self, sizes: Mapping[str, str]) -> None:
        self._sizes = sizes

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """The expression that stands for a name, if there is one."""
        return ast.parse(self._sizes[node.id], mode="eval").body if node.id in self._sizes else node


def _outer(expression: str, sizes: Mapping[str, str]) -> str:
    """An expression of a nested declaration's sizes in terms of those of the outermost one."""
    return ast.unparse(_Substitution(sizes).visit(ast.parse(expression, mode="eval").body))
