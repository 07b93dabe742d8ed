"""Tensors that the maker does not publish: they are estimated from those of another arm, as the files say."""

import numpy as np
import pytest

from contactsense import robots
from contactsense.robots.robot import Link


def shortened(link: Link, mass: float, com: float, length: float, shorter: float) -> np.ndarray:
    """Tensor of a link along x after a piece in the middle of its tube has been taken out.

    Args:
        link: The longer link, whose next joint is at x = -length.
        mass: Mass of the shorter link [kg].
        com: Place of its centre of mass along x [m].
        length: Distance of the joints of the longer link [m].
        shorter: Length of the piece [m].

    Returns:
        Shape (3, 3), about the centre of mass, link axes [kg m^2].
    """
    piece, middle = link.inertia.mass - mass, -0.5 * length
    # The part beyond the piece is taken to be at the next joint. It moves by `shorter`; the first moments
    # give its mass.
    beyond = (mass * com - link.inertia.mass * link.inertia.com[0] + piece * middle) / shorter
    change = (
        link.inertia.mass * link.inertia.com[0] ** 2
        - piece * (middle**2 + shorter**2 / 12.0)
        + beyond * ((shorter - length) ** 2 - length**2)
        - mass * com**2
    )
    return link.inertia.tensor + np.diag([0.0, change, change])


def test_the_measured_tensor_of_the_ur16e_is_found() -> None:
    """Its upper arm is the UR10e's, 134.3 mm shorter."""
    longer, known = robots.load("ur10e").links[2], robots.load("ur16e").links[2]
    found = shortened(longer, known.inertia.mass, known.inertia.com[0], length=0.6127, shorter=0.1343)
    np.testing.assert_allclose(np.diag(found), np.diag(known.inertia.tensor), rtol=0.02)


@pytest.mark.parametrize(("link", "length"), [(2, 0.862), (3, 0.7287)])
def test_ur30(link: int, length: float) -> None:
    longer, shorter = robots.load("ur20").links[link], robots.load("ur30").links[link]
    found = shortened(longer, shorter.inertia.mass, shorter.inertia.com[0], length, shorter=0.225)
    np.testing.assert_allclose(shorter.inertia.tensor, found, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("name", ["ur3", "ur5"])
def test_cb3_has_the_tensors_of_the_e_series_in_proportion_to_the_masses(name: str) -> None:
    for old, new in zip(robots.load(name).links[1:], robots.load(f"{name}e").links[1:], strict=True):
        expected = new.inertia.tensor * old.inertia.mass / new.inertia.mass
        np.testing.assert_allclose(old.inertia.tensor, expected, rtol=1e-3, atol=1e-9)
