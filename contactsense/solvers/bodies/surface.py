"""Interface and helpers common to all surfaces."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from numbers import Real
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from contactsense.robots.rotations import symmetric
from contactsense.robots.surface.convex_primitives import curvature
from contactsense.sensors.validation import as_floats
from contactsense.solvers.solution import Answer

Kernel = Callable[..., Answer]
Problem = tuple[Kernel, tuple[Any, ...]]
"""A compiled solver and its arguments after the wrench."""


class Surface(Protocol):
    """A surface with an outward normal that bounds a convex body and can be solved."""

    def problem(self) -> Problem:
        """The kernel of the exact solution, and the surface's size as its arguments."""
        ...

    def line_problem(self) -> Problem:
        """The same for the wrench axis alone."""
        ...

    def shape_operator(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Derivative of the outward normal with respect to the position on the surface, at one point.

        Args:
            point: Surface point [m], shape (3,).
            normal: Outward unit normal there, shape (3,).

        Returns:
            W with dn = W dc [1/m], shape (3, 3), symmetric, W n = 0.
        """
        ...


class KernelSurface:
    """A surface that one pair of kernels solves."""

    kernels: ClassVar[tuple[Kernel, Kernel]]
    """Exact solver, and wrench axis."""

    def __post_init__(self) -> None:
        positive(self, **vars(self))

    def arguments(self) -> tuple[Any, ...]:
        """What the kernels take after the wrench: the surface's fields, unless it says otherwise."""
        return tuple(float(value) for value in vars(self).values())

    def problem(self) -> Problem:
        """See `Surface`."""
        return self.kernels[0], self.arguments()

    def line_problem(self) -> Problem:
        """See `Surface`."""
        return self.kernels[1], self.arguments()


class EqualByFields:
    """A dataclass that equals another of its type with equal fields, arrays among them; NaN equals NaN."""

    __slots__ = ()
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return False
        pairs = [(getattr(self, x.name), getattr(other, x.name)) for x in fields(self)]  # type: ignore[arg-type]
        return all(
            np.array_equal(one, same, equal_nan=True)
            if isinstance(one, np.ndarray | float)
            else bool(one == same)
            for one, same in pairs
        )


def vectors(name: str, values: ArrayLike, dimensions: int) -> np.ndarray:
    """A copy of one vector (`dimensions` 1) or of rows of them (2), NaN where they are masked.

    Raises:
        ValueError: It has another shape or is no number; the message names it.
    """
    array = np.array(as_floats(name, values))
    if array.ndim != dimensions or array.shape[-1] != 3:
        expected = "(3,)" if dimensions == 1 else "(N, 3)"
        raise ValueError(f"{name}: expected shape {expected}, not {array.shape}")
    return array


def positive(surface: object, **lengths: float) -> None:
    """Reject lengths that are not positive and finite."""
    _numbers(surface, lengths)
    for name, value in lengths.items():
        if not 0.0 < value < np.inf:
            raise ValueError(f"{type(surface).__name__}: {name} must be positive and finite, not {value}")


def not_negative(surface: object, **lengths: float) -> None:
    """Reject lengths that are negative or not finite."""
    _numbers(surface, lengths)
    for name, value in lengths.items():
        if not 0.0 <= value < np.inf:
            raise ValueError(f"{type(surface).__name__}: {name} must not be negative, not {value}")


def _numbers(surface: object, lengths: Mapping[str, object]) -> None:
    for name, value in lengths.items():
        if not isinstance(value, Real):
            raise TypeError(f"{type(surface).__name__}: {name} must be a number, not {value!r:.60}")


def tangential(bend: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Tangential part of a symmetric matrix, shape (3, 3)."""
    project = np.eye(3) - np.outer(normal, normal)
    return np.asarray(project @ bend @ project)


def around_axis(normal: np.ndarray, bend: float) -> np.ndarray:
    """Shape operator (3, 3) [1/m] of a surface that is curved around z only, by `bend` [1/m], where its unit
    normal (3,) is not along z."""
    along = np.array((-normal[1], normal[0], 0.0)) / np.hypot(normal[0], normal[1])
    return np.asarray(bend * np.outer(along, along))


def packed_shape(kind: int, size: tuple[float, ...], point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Shape operator (3, 3) [1/m] of a primitive as `contactsense.robots.surface.convex_primitives` packs it.

    `point`, `normal`: surface point [m] and outward unit normal there, body frame, shapes (3,).
    """
    return symmetric(curvature(kind, size, *point, *normal))


def level_shape(level: tuple[float, ...], normal: np.ndarray) -> np.ndarray:
    """Shape operator (3, 3) [1/m] where the surface has this unit normal (3,), from value, gradient and
    Hessian (xx, yy, zz, xy, xz, yz) of a function that is constant on the surface."""
    _, gx, gy, gz, xx, yy, zz, xy, xz, yz = level
    bend = symmetric((xx, xy, xz, yy, yz, zz))
    return tangential(bend, normal) / float(np.linalg.norm((gx, gy, gz)))
