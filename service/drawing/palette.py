"""Colours of drawings, distinguishable for the colour-blind and on a projector, on light and dark ground.

Every two of the colours of links, contacts and what is unknown differ by at least `LEAST_DIFFERENCE`, seen
normally and by the model of Machado, Oliveira and Fernandes (2009) for the three kinds of colour blindness.
"""

from collections.abc import Sequence

import numpy as np

LEAST_DIFFERENCE = 25.0
"""Distance in CIELAB; 2.3 is just noticeable."""
LINK_COLOURS = (
    "#83867f", "#489ae2", "#e17a00", "#55eaaf", "#8d4388", "#b7d4ef", "#b41f00", "#ded371", "#434cbf",
)  # fmt: skip
"""One colour per link, repeated cyclically."""
CONTACT = "#8400fc"
"""Of arrows and regions of contacts."""
NOWHERE = "#2f3337"
"""Of contacts without a single place."""
SERIES = ("#332288", "#e69f00", "#117733", "#56b4e9", "#882255", "#000000")
"""Of curves and marks on white, distinguishable to the colour-blind as links are: indigo, green, wine of P.
Tol, Colour Schemes (2021), orange, sky blue and black of M. Okabe and K. Ito."""
ON_ANY_GROUND = ("#3b7ddd", "#e0457b", "#7d8a00")
"""Of curves on a page that may be white or dark."""
AXES = ("#d55e00", "#009e73", "#0072b2")
"""Of the axes x, y and z of a frame: vermilion, green and blue of M. Okabe and K. Ito, Color Universal
Design (2008)."""
UNTOUCHED, TOUCHED = "#c9ced6", "#b3470a"
"""Of links that are touched with probability 0 and 1."""
UNFELT = "#d9d9de"
"""Of heat maps, where the value is beyond the scale."""
HEAT = (
    "#fde725", "#d8e219", "#addc30", "#84d44b", "#5ec962", "#3fbc73", "#28ae80", "#1fa088", "#21918c",
    "#26828e", "#2c728e", "#33638d", "#3b528b", "#424086", "#472d7b", "#48186a", "#440154",
)  # fmt: skip
"""Colours of heat maps, equally spaced: Matplotlib's viridis, from its bright end."""

WIDEST_SCALE = 100.0
"""Largest ratio of the values at both ends of a heat map's scale."""


def link_colour(index: int) -> str:
    """Colour of a link as a hexadecimal code; index -1: no link."""
    return NOWHERE if index < 0 else LINK_COLOURS[index % len(LINK_COLOURS)]


def probability_colour(probability: float) -> str:
    """Colour of a link that is touched with a probability from 0 to 1, as a hexadecimal code; the darker, the
    more probable. NaN counts as 0."""
    probability = 0.0 if np.isnan(probability) else probability
    blend = between((UNTOUCHED, TOUCHED), np.array([probability]))[0]
    return "#" + "".join(f"{part:02x}" for part in blend)


def heat_scale(values: np.ndarray) -> tuple[float, float]:
    """Values at the bright and the dark end of a heat map, for `heat_colours`.

    Args:
        values: Positive values, shape (N,). Those that are not finite are left out; there may be no other.
    """
    known = values[np.isfinite(values)]
    low = float(known.min()) if len(known) else 1.0
    return low, min(max(float(known.max(initial=low)), 1.2 * low), WIDEST_SCALE * low)


def heat_colours(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Colours of positive values on a logarithmic scale, bright where they are small.

    Args:
        values: Shape (N,).
        low: Value of the bright end; what is below has its colour.
        high: Value of the dark end; what is above, and NaN, has the colour `UNFELT`.

    Returns:
        Red, green and blue, shape (N, 3), uint8.

    Raises:
        ValueError: not 0 < low < high.
    """
    if not 0.0 < low < high < np.inf:
        raise ValueError(f"low, high: expected 0 < low < high, got {low:g} and {high:g}")
    values = np.asarray(values, dtype=np.float64)
    known = values <= high
    place = np.log(np.where(known, np.maximum(values, low), low) / low) / np.log(high / low)
    colours = between(HEAT, place)
    colours[~known] = rgb(UNFELT)
    return colours


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of a hexadecimal code, 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def between(colours: Sequence[str], place: np.ndarray) -> np.ndarray:
    """Colours at places from 0 to 1 between equally spaced ones, shape (N, 3), uint8."""
    stops = np.array([rgb(colour) for colour in colours], dtype=np.float64)
    at = np.linspace(0.0, 1.0, len(stops))
    parts = [np.interp(place, at, stops[:, i]) for i in range(3)]
    return np.asarray(np.rint(np.stack(parts, axis=-1)), dtype=np.uint8)
