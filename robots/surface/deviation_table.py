"""How far the real surface is from the primitives of a body: its cells as lines of a file.

A line has the number of the primitive, the place x y z [mm], and the standard deviations of distance [mm] and
normal [degrees]; perhaps also the mean shift [mm] and the mean rotation vector [degrees] of the surface.
"""

from math import degrees, hypot, isfinite, radians
from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from contactsense.robots.robot import LocalDeviation

LARGEST_SHIFT = 500.0
"""Largest distance of a skin from a primitive that stands for it [mm]."""


def read_cells(text: str, primitives: int) -> tuple[LocalDeviation, ...]:
    """The cells in the lines of a table.

    Args:
        text: The lines.
        primitives: Number of primitives of the body.

    Raises:
        ValueError: a line has neither six nor twelve numbers, names a primitive that is not there, a
            deviation is not positive, or a motion is larger than any skin is from its primitive.
    """
    found = []
    for line in text.splitlines():
        numbers = _numbers(line)
        if len(numbers) not in (6, 12) or numbers[0] not in range(primitives):
            raise ValueError(
                f"expected finite numbers: a primitive below {primitives}, x, y, z and two deviations, "
                f"perhaps a shift and a rotation vector, got {line!r}"
            )
        number, x, y, z, offset, tilt, *motion = numbers
        if not (offset > 0.0 and 0.0 <= tilt <= 90.0):
            raise ValueError(f"expected a positive distance and an angle from 0 to 90, got {line!r}")
        a, b, c, alpha, beta, gamma = motion or (0.0,) * 6
        if hypot(a, b, c) > LARGEST_SHIFT or hypot(alpha, beta, gamma) > 90.0:
            raise ValueError(
                f"expected a shift of at most {LARGEST_SHIFT:g} mm and a rotation of at most 90 degrees, "
                f"got {line!r}"
            )
        point = (1e-3 * x, 1e-3 * y, 1e-3 * z)
        shift, turn = (1e-3 * a, 1e-3 * b, 1e-3 * c), (radians(alpha), radians(beta), radians(gamma))
        found.append(LocalDeviation(int(number), point, 1e-3 * offset, radians(tilt), shift, turn))
    return tuple(found)


def _numbers(line: str) -> list[float]:
    """The numbers of a line; none if one is no finite number."""
    try:
        numbers = [float(value) for value in line.split()]
    except ValueError:
        return []
    return numbers if all(map(isfinite, numbers)) else []


def lines(cells: tuple[LocalDeviation, ...]) -> list[str]:
    """Cells as the lines of a table; with motions only if there is one that is not zero."""
    moved = any(value != 0.0 for cell in cells for value in (*cell.shift, *cell.turn))
    return [f"{_deviation(cell)} {_motion(cell)}" if moved else _deviation(cell) for cell in cells]


def _deviation(cell: LocalDeviation) -> str:
    place = " ".join(f"{1e3 * value:.0f}" for value in cell.point)
    return f"{cell.primitive} {place} {1e3 * cell.offset:.2f} {degrees(cell.tilt):.0f}"


def _motion(cell: LocalDeviation) -> str:
    shift, turn = (f"{1e3 * value:.2f}" for value in cell.shift), (f"{degrees(v):.0f}" for v in cell.turn)
    return " ".join((*shift, *turn))


def _fits_the_primitives(text: str, info: ValidationInfo) -> str:
    if "primitives" in info.data:  # otherwise they are wrong themselves
        if text and not info.data["primitives"]:
            raise ValueError("expected primitives as well, whose deviation it is, got none")
        read_cells(text, len(info.data["primitives"]))
    return text


DeviationTable = Annotated[str, AfterValidator(_fits_the_primitives)]
"""Field of a pydantic model that has `primitives` before it: the lines of a table for these."""
