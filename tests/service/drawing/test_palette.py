"""Colours that differ for everyone, by the model of Machado, Oliveira and Fernandes, A Physiologically-based
Model for Simulation of Color Vision Deficiency, IEEE TVCG 15 (2009), at full severity."""

from itertools import pairwise

import numpy as np
import pytest

from contactsense.service.drawing import palette

VISION = {
    "normal": np.eye(3),
    "protanopia": np.array([
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998],
    ]),
    "deuteranopia": np.array([
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881],
    ]),
    "tritanopia": np.array([
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900],
    ]),
}  # fmt: skip


def lab(colours: np.ndarray, vision: str) -> np.ndarray:
    """CIELAB (N, 3) of sRGB colours (N, 3), 0 to 255, as they are seen."""
    shares = np.asarray(colours) / 255.0
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ VISION[vision].T, 0.0, 1.0)
    to_xyz = np.array([
        [0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ])  # fmt: skip
    xyz = linear @ to_xyz.T / (0.95047, 1.0, 1.08883)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.stack((116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])), axis=1)


def differences(colours: list[str], vision: str) -> np.ndarray:
    seen = lab(np.array([palette.rgb(colour) for colour in colours]), vision)
    return np.linalg.norm(seen[:, None] - seen[None], axis=2)[np.triu_indices(len(seen), 1)]


def contrast(colour: str, ground: str) -> float:
    """Ratio of contrast of WCAG 2.2."""
    lightness = lab(np.array([palette.rgb(colour), palette.rgb(ground)]), "normal")[:, 0]
    low, high = np.sort(((lightness + 16.0) / 116.0) ** 3)
    return float((high + 0.05) / (low + 0.05))


@pytest.mark.parametrize("vision", VISION)
def test_links_and_contacts_are_told_apart(vision: str) -> None:
    colours = [*palette.LINK_COLOURS, palette.CONTACT, palette.NOWHERE]
    assert differences(colours, vision).min() >= palette.LEAST_DIFFERENCE


@pytest.mark.parametrize("vision", VISION)
def test_curves_are_told_apart_and_stand_out_on_white(vision: str) -> None:
    assert differences(list(palette.SERIES), vision).min() >= palette.LEAST_DIFFERENCE
    assert differences([*palette.SERIES, "#ffffff"], vision).min() >= palette.LEAST_DIFFERENCE


@pytest.mark.parametrize("vision", VISION)
def test_curves_of_a_page_are_told_apart_on_white_and_on_dark(vision: str) -> None:
    grounds = ["#ffffff", "#242424"]
    assert differences([*palette.ON_ANY_GROUND, *grounds], vision).min() >= palette.LEAST_DIFFERENCE
    for colour in palette.ON_ANY_GROUND:
        assert min(contrast(colour, ground) for ground in grounds) >= 3.0  # WCAG 2.2, 1.4.11


@pytest.mark.parametrize("vision", VISION)
def test_axes_are_told_apart(vision: str) -> None:
    # They carry letters, too.
    assert differences(list(palette.AXES), vision).min() >= 15.0


def test_the_test_sees_what_the_colour_blind_do_not() -> None:
    assert differences(["#d62728", "#2ca02c"], "normal").min() > 100.0
    assert differences(["#d62728", "#2ca02c"], "deuteranopia").min() < 10.0


@pytest.mark.parametrize("vision", VISION)
def test_scales_darken_steadily(vision: str) -> None:
    forces = np.geomspace(1.0, 100.0, 50)
    heat = lab(palette.heat_colours(forces, 1.0, 100.0), vision)
    shares = [palette.rgb(palette.probability_colour(p)) for p in np.linspace(0.0, 1.0, 20)]
    for seen in (heat, lab(np.array(shares), vision)):
        assert (np.diff(seen[:, 0]) < 0.0).all()
        assert seen[0, 0] - seen[-1, 0] > palette.LEAST_DIFFERENCE
    unfelt = lab(np.array([palette.rgb(palette.UNFELT)]), vision)
    assert np.linalg.norm(heat - unfelt, axis=1).min() > 10.0


def test_heat_is_logarithmic_and_shows_what_is_beyond_the_scale() -> None:
    low, middle, high, beyond, unknown, below = palette.heat_colours(
        np.array([2.0, 20.0, 200.0, 201.0, np.nan, 0.0]), 2.0, 200.0
    )
    assert tuple(low) == tuple(below) == palette.rgb(palette.HEAT[0])
    assert tuple(middle) == palette.rgb(palette.HEAT[8])
    assert tuple(high) == palette.rgb(palette.HEAT[-1])
    assert tuple(beyond) == tuple(unknown) == palette.rgb(palette.UNFELT)
    with pytest.raises(ValueError, match="expected 0 < low < high, got 0 and 1"):
        palette.heat_colours(np.ones(1), 0.0, 1.0)


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([3.0, 8.0, np.inf, np.nan], (3.0, 8.0)),
        ([3.0, 800.0], (3.0, 300.0)),
        ([5.0, np.inf], (5.0, 6.0)),
        ([np.inf, np.nan], (1.0, 1.2)),
        ([], (1.0, 1.2)),
    ],
)
def test_the_scale_of_heat_spans_what_is_known(values: list[float], scale: tuple[float, float]) -> None:
    assert palette.heat_scale(np.array(values)) == scale


def test_pictures_of_robots_have_the_same_colours() -> None:
    rendering = pytest.importorskip("contactsense.robots.surface.rendering")
    assert [palette.rgb(colour) for colour in palette.LINK_COLOURS] == list(rendering.COLOURS)


def test_links_without_a_number_and_beyond_the_last_colour() -> None:
    assert palette.link_colour(-1) == palette.NOWHERE
    assert palette.link_colour(len(palette.LINK_COLOURS)) == palette.link_colour(0)
    assert all(a != b for a, b in pairwise(palette.LINK_COLOURS))
    assert palette.probability_colour(float("nan")) == palette.probability_colour(0.0) == palette.UNTOUCHED
    assert palette.probability_colour(1.0) == palette.TOUCHED
