"""Symmetric matrices and vectors, changed in place: against NumPy."""

import numpy as np

from contactsense.kinematics.linalg.outer_product import add_outer_product, add_scaled_vector, symmetrize


def test_a_square_is_added_to_the_upper_triangle_which_is_mirrored() -> None:
    chance = np.random.default_rng(1)
    H, row = chance.normal(size=(6, 6)), chance.normal(size=6)
    expected = H + np.triu(-0.7 * np.outer(row, row))
    add_outer_product(H, -0.7, row)
    np.testing.assert_allclose(H, expected, rtol=1e-13)
    upper = np.triu(H)
    symmetrize(H)
    np.testing.assert_array_equal(H, upper + np.triu(H, 1).T)


def test_a_slope_is_added() -> None:
    chance = np.random.default_rng(2)
    g, row = chance.normal(size=6), chance.normal(size=6)
    expected = g + 0.3 * row
    add_scaled_vector(g, 0.3, row)
    np.testing.assert_allclose(g, expected, rtol=1e-14)
