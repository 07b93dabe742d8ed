"""Covariance along two tangents and as a matrix: against numpy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from contactsense.kinematics.wrench_information import symmetric_matvec
from contactsense.localization.candidates.place_covariance import along_tangents, from_tangents
from contactsense.robots.vectors import tangents

UPPER = np.triu_indices(3)
components = st.floats(-1.0, 1.0)


@given(st.tuples(components, components, components), st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_it_is_the_matrix_in_the_plane_of_the_tangents(
    normal: tuple[float, float, float], values: tuple[float, float, float]
) -> None:
    length = float(np.linalg.norm(normal))
    normal = (0.0, 0.0, 1.0) if length < 1e-3 else tuple(np.array(normal) / length)
    T, (v11, v12, v22) = np.array(tangents(normal)), values
    axes = tuple(map(tuple, T.tolist()))
    C = T.T @ np.array([[v11, v12], [v12, v22]]) @ T
    found = from_tangents(values, axes)
    np.testing.assert_allclose(found, C[UPPER], atol=1e-12)
    np.testing.assert_allclose(along_tangents(found, axes), values, atol=1e-12)
    np.testing.assert_allclose(symmetric_matvec(found, (0.3, -0.2, 0.7)), C @ [0.3, -0.2, 0.7], atol=1e-12)
