"""Why a link is beyond the limit, on distances that are given."""

import numpy as np

from contactsense.benchmarks.accuracy.link_geometry import LIMIT, reason

POINTS = np.tile([0.0, 0.0, 0.1], (100, 1))


def test_a_link_within_the_limit_needs_no_reason() -> None:
    skin = np.full(100, 0.5 * LIMIT)
    skin[:4] = 10.0 * LIMIT  # 4 % are beyond, but not the 95th percentile
    assert reason(skin, np.zeros(50), POINTS) == ""


def test_a_recess_is_told_with_its_depth_and_place() -> None:
    skin, points, primitive = np.zeros(100), POINTS.copy(), np.zeros(50)
    skin[:10], points[:10], primitive[:10] = -0.005, [0.01, 0.02, -0.007], 0.004
    assert reason(skin, primitive, points) == (
        "10 % of the skin is below the primitives, up to 5.0 mm, about (10, 20, -7) mm; "
        "20 % of the primitives' surface has no skin near"
    )


def test_missing_skin_is_told_as_such() -> None:
    skin = np.zeros(100)
    skin[:10] = 0.003
    found = reason(skin, np.zeros(50), POINTS)
    assert found == "10 % of the skin is above the primitives, up to 3.0 mm, about (0, 0, 100) mm"
