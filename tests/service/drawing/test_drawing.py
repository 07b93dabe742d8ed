"""Meshes that lie on the surface, regions of the right size, axes with round numbers."""

import numpy as np
import pytest

from contactsense.service.drawing.arm_scene import arm_view, region_outline
from contactsense.service.drawing.timeline_svg import Curve, nice_step, panel


def test_the_region_holds_nine_of_ten_places() -> None:
    rng = np.random.default_rng(3)
    normal = np.array([0.6, 0.0, 0.8])
    A = rng.standard_normal((3, 3)) * 1e-3
    outline = region_outline(np.zeros(3), normal, A @ A.T)
    np.testing.assert_allclose(outline @ normal, 0.0, atol=1e-12)
    places = rng.standard_normal((20000, 3)) @ A.T
    places -= np.outer(places @ normal, normal)
    inverse = np.linalg.pinv(outline.T @ outline / len(outline) * 2.0)
    assert np.mean(np.einsum("ij,jk,ik->i", places, inverse, places) <= 1.0) == pytest.approx(0.9, abs=0.01)


def test_a_view_without_a_place_draws_the_arm_alone() -> None:
    poses = [(np.zeros(3), np.eye(3))]
    view = arm_view(poses, np.array([0.0, 0.0, 1.0]), np.full(3, np.nan), np.ones(3))
    assert sorted(view) == ["poses", "up"]


@pytest.mark.parametrize(
    ("value", "step"), [(0.3, 0.5), (1.0, 1.0), (7.0, 10.0), (20.0, 20.0), (0.0011, 0.002)]
)
def test_axes_have_round_numbers(value: float, step: float) -> None:
    assert nice_step(value) == pytest.approx(step)


def test_a_panel_without_curves_is_a_picture_too() -> None:
    empty = Curve(np.empty(0), np.empty(0), "#000")
    assert panel([empty], (0.0, 0.0), "N", "a <title>").count("<svg") == 1
    assert "a &lt;title&gt;" in panel([empty], (0.0, 1.0), "N", "a <title>")
