"""Whether an inertia tensor is that of a body."""

import numpy as np

ROUNDING = 0.01
"""Share of the largest principal moment by which rounded numbers may contradict each other, as those of a
thin plate or rod do."""


def check_principal_moments(tensor: np.ndarray) -> None:
    """Check an inertia tensor about the centre of mass, shape (3, 3) [kg m^2]; a point mass has zeros.

    Raises:
        ValueError: A principal moment is negative or larger than the sum of the others, which no body has.
    """
    moments = np.linalg.eigvalsh(tensor)
    room = ROUNDING * float(np.abs(moments).max())
    if moments[0] < -room or moments[2] > moments[0] + moments[1] + room:
        shown = ", ".join(f"{moment:.4g}" for moment in moments)
        raise ValueError(
            "expected the inertia of a body, whose principal moments are not negative and none larger than "
            f"the sum of the others, got principal moments {shown} kg m^2"
        )
