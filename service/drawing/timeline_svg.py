"""Curves over time as inline SVG."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 1000, 62, 14, 12, 44
DIGIT = 13
"""Width of a digit where a panel is drawn at half its size and its letters are enlarged."""
LETTER = 11
"""Width of a letter on a narrow screen, where letters are enlarged."""
COLUMN = 0.5
"""Width of a column of the picture in which a curve's extremes tell all that can be seen."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve of a panel."""

    x: np.ndarray
    """Shape (K,) [s]."""
    y: np.ndarray
    """Shape (K,); NaN: not known, the curve has a gap."""
    colour: str
    """CSS colour."""
    label: str = ""
    """Shown as a tooltip."""
    filled: bool = False
    """Whether the area below it is filled."""
    dashed: bool = False
    """Whether the line is dashed."""


def panel(
    curves: Sequence[Curve], span: tuple[float, float], unit: str, title: str, height: int = 190
) -> str:
    """A panel of curves with axes: x is time [s] over `span`, y starts at zero in `unit`.

    Times are those of the curves, so that they are the same as in tables.
    """
    values = [float(np.nanmax(curve.y)) for curve in curves if len(curve.y) and np.isfinite(curve.y).any()]
    largest = max(values, default=0.0)
    if largest <= 0.0:
        largest = 1.0  # an axis without a force has usual numbers, too
    step = nice_step(largest / 4.0)
    limit = step * np.ceil(1.02 * largest / step)
    # One sample has no duration, and near a UNIX time two numbers are 2e-7 s apart.
    low, high = span[0], max(span[1], span[0] + 1e-3)
    inner, depth = WIDTH - LEFT - RIGHT, height - TOP - BOTTOM

    def at(x: float, y: float) -> tuple[float, float]:
        return LEFT + inner * (x - low) / (high - low), TOP + depth * (1.0 - y / limit)

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title, True)}">'
        f"<title>{escape(title)}</title>"
    ]
    for k in range(round(limit / step) + 1):
        _, y = at(low, k * step)
        parts.append(
            f'<line class="grid" x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}"/>'
            f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{k * step:.4g}</text>'
        )
    for time, label in _ticks(low, high, inner):
        x, _ = at(time, 0.0)
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{TOP + depth}"/>')
        half = 0.5 * DIGIT * len(label)
        if half <= x <= WIDTH - half:  # else a part of it would be outside of the picture
            parts.append(f'<text x="{x:.1f}" y="{TOP + depth + 19}" text-anchor="middle">{label}</text>')
    parts += [_curve(curve, at) for curve in curves if len(curve.x)]
    middle = max(TOP + depth / 2, 0.5 * LETTER * len(unit))  # else the unit's end would be outside
    parts.append(
        f'<text x="{WIDTH - RIGHT}" y="{height - 4}" text-anchor="end">time / s</text>'
        f'<text x="16" y="{middle:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 16 {middle:.0f})">{escape(unit)}</text></svg>'
    )
    return "".join(parts)


def nice_step(value: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is not below `value`."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-12)))
    return float(next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= value * (1.0 - 1e-9)))


def _ticks(low: float, high: float, width: int) -> list[tuple[float, str]]:
    """Round times from `low` to `high` with their labels, which do not overlap on an axis of that width."""
    step = nice_step((high - low) / 8.0)
    # A clock that counts from 1970 needs more digits than others, for which fewer times have room.
    label = DIGIT * (1 + len(f"{high:.{_decimals(step)}f}"))
    step = nice_step((high - low) * max(1.0 / 8.0, label / width))
    numbers = range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)
    return [(k * step, f"{k * step:.{_decimals(step)}f}") for k in numbers]


def _decimals(step: float) -> int:
    """Decimals that distinguish multiples of a `nice_step`."""
    return max(0, -int(np.floor(np.log10(step) + 1e-9)))


def _curve(curve: Curve, at: Callable[[float, float], tuple[float, float]]) -> str:
    parts = np.split(np.arange(len(curve.y)), np.flatnonzero(~np.isfinite(curve.y)))
    known = [part[np.isfinite(curve.y[part])] for part in parts]
    return "".join(_part(curve, curve.x[part], curve.y[part], at) for part in known if len(part))


def _part(
    curve: Curve, x: np.ndarray, y: np.ndarray, at: Callable[[float, float], tuple[float, float]]
) -> str:
    """A part of a curve without a gap."""
    places = _seen(np.array([at(*place) for place in zip(x.tolist(), y.tolist(), strict=True)])).tolist()
    if len(places) == 1:  # a line of one point is not to be seen
        places.append((places[0][0] + 1.0, places[0][1]))
    label = f"<title>{escape(curve.label)}</title>" if curve.label else ""
    dash = ' stroke-dasharray="5 3"' if curve.dashed else ""
    line = " ".join(f"{right:.1f},{down:.1f}" for right, down in places)
    shape = f'<polyline points="{line}" fill="none" stroke="{curve.colour}"{dash}>{label}</polyline>'
    if not curve.filled:
        return shape
    ground = at(0.0, 0.0)[1]
    area = f"{places[0][0]:.1f},{ground:.1f} {line} {places[-1][0]:.1f},{ground:.1f}"
    return f'<polygon points="{area}" fill="{curve.colour}" fill-opacity="0.3">{label}</polygon>{shape}'


def _seen(places: np.ndarray) -> np.ndarray:
    """Of a line's points, shape (K, 2), from left to right, those that can be seen: in each column the first,
    the last, the highest and the lowest. A long recording has thousands of contacts, each narrower than a
    column."""
    column = np.floor(places[:, 0] / COLUMN)
    begins = np.flatnonzero(np.diff(column, prepend=-np.inf))
    ends = np.append(begins[1:], len(places)) - 1
    by_height = np.lexsort((places[:, 1], column))
    kept = np.unique(np.concatenate([begins, ends, by_height[begins], by_height[ends]]))
    return np.take(places, kept, axis=0)
