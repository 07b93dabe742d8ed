"""One check of inertia tensors for tools, arm files and URDFs."""

import numpy as np
import pytest

from contactsense.robots.principal_moments import ROUNDING, check_principal_moments
from contactsense.robots.rotations import rotation_from_rpy


def turned(*moments: float) -> np.ndarray:
    """A tensor with these principal moments, in other axes."""
    R = rotation_from_rpy((0.3, -0.7, 1.1))
    return np.asarray(R @ np.diag(moments) @ R.T)


@pytest.mark.parametrize(
    "moments",
    [
        (0.0, 0.0, 0.0),
        (1.0, 1.0, 1.0),
        (0.0, 1.0, 1.0),  # a rod
        (1.0, 1.0, 2.0),  # a plate
        (1.0, 1.0, 2.0 + 0.9 * 2.0 * ROUNDING),
        (-0.9 * ROUNDING, 1.0, 1.0),
    ],
)
def test_bodies_and_their_rounded_numbers_are_accepted(moments: tuple[float, ...]) -> None:
    check_principal_moments(turned(*moments))


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.0 + 1.2 * 2.0 * ROUNDING), (-1.2 * ROUNDING, 1.0, 1.0)])
def test_what_no_body_has_is_refused(moments: tuple[float, ...]) -> None:
    shown = ", ".join(f"{moment:.4g}" for moment in sorted(moments))
    with pytest.raises(
        ValueError, match=f"^expected the inertia of a body, .* got principal moments {shown} kg"
    ):
        check_principal_moments(turned(*moments))
