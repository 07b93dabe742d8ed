"""Units of force and length in which a wrench and a surface are of order one, powers of two."""

from math import frexp, ldexp
from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector
from contactsense.solvers.solution import OK, Answer, input_status
from contactsense.solvers.wrench import Wrench, invariant

SMALL, LARGE = 1e-120, 1e120
"""Squares between these can be squared again without leaving the range of floats."""

_FAINT = 300
"""A force weaker than the moment by more than 2^300 does not move the contact; the kernels take it as this
weak."""


class Units(NamedTuple):
    """Exponents of units that are powers of two, so that converting does not round."""

    force: int
    """Of the unit of the force."""
    moment: int
    """Of the unit of the moment over that of length; another one than `force` only where the force is too
    faint to matter."""
    length: int
    """Of the unit of length."""


@kernel
def exponent(x: float) -> int:
    """Exponent of the power of two that |x| is below."""
    return frexp(x)[1] + 0  # the sum has 64 bits like all integers; Numba's `frexp` returns 32


@kernel
def units_for(wrench: Wrench, length: float) -> Units:
    """Units in which a wrench and a surface of size `length` are of order one."""
    f, m = wrench
    k = exponent(length)
    force = exponent(max(abs(f[0]), abs(f[1]), abs(f[2])))
    moment = max(abs(m[0]), abs(m[1]), abs(m[2]))
    e = max(force, exponent(moment) - k) if moment > 0.0 else force
    return Units((e if force > e - _FAINT else force + _FAINT), e, k)


@kernel
def scale_by_power(a: Vector, exponent: int) -> Vector:
    """A vector times 2^exponent."""
    return ldexp(a[0], exponent), ldexp(a[1], exponent), ldexp(a[2], exponent)


@kernel
def to_units(wrench: Wrench, units: Units) -> Wrench:
    """The wrench in these units."""
    return Wrench(
        scale_by_power(wrench.force, -units.force),
        scale_by_power(wrench.moment, -(units.moment + units.length)),
    )


@kernel
def is_pure_force(wrench: Wrench) -> bool:
    """Whether f.m is exactly zero, whatever the units. In another frame, rounding would make it a torsion,
    for which a line of action that passes by has a contact (`contactsense.solvers.wrench.invariant`)."""
    f, m = wrench
    force = exponent(max(abs(f[0]), abs(f[1]), abs(f[2])))
    moment = exponent(max(abs(m[0]), abs(m[1]), abs(m[2])))
    return bool(invariant(Wrench(scale_by_power(f, -force), scale_by_power(m, -moment))) == 0.0)


@kernel
def in_units(wrench: Wrench, length: float) -> tuple[int, Wrench, Units]:
    """Status of a wrench (`input_status`), the wrench in units in which it and a surface of size `length` are
    of order one, and these units."""
    status = input_status(wrench)
    units = units_for(wrench, length) if status == OK else Units(0, 0, 0)
    return status, to_units(wrench, units), units


@kernel
def length_to_units(length: float, units: Units) -> float:
    """A length in these units."""
    return ldexp(length, -units.length)


@kernel
def from_units(answer: Answer, units: Units) -> Answer:
    """An answer in these units, in those of the input."""
    return Answer(
        answer.status,
        scale_by_power(answer.centroid, units.length),
        answer.normal,
        ldexp(answer.torsion, units.moment + units.length),
        answer.residual,
        ldexp(answer.condition, units.force - units.moment),
    )
