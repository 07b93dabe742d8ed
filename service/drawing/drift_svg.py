"""Values of several joints over days as inline SVG."""

from collections.abc import Sequence
from html import escape

import numpy as np

from contactsense.service.drawing.palette import link_colour
from contactsense.service.drawing.timeline_svg import nice_step

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 1000, 170, 62, 120, 10, 24


def drift_chart(dates: Sequence[str], values: np.ndarray, names: Sequence[str], unit: str, title: str) -> str:
    """A chart with one curve for each joint; the axis includes zero.

    Args:
        dates: The D days, equally spaced.
        values: Shape (D, n); NaN values are not drawn.
        names: Names of the joints.
        unit: Unit of the values.
        title: Text alternative for screen readers.
    """
    known = values[np.isfinite(values)]
    low, high = float(min(known.min(initial=0.0), 0.0)), float(max(known.max(initial=0.0), 0.0))
    step = nice_step(max(high - low, 1e-9) / 3.0)
    low, high = step * np.floor(low / step), step * max(np.ceil(high / step), np.floor(low / step) + 1.0)
    inner, depth = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def x_at(i: int) -> float:
        return LEFT + inner * (i / max(len(dates) - 1, 1))

    def y_at(value: float) -> float:
        return float(TOP + depth * (high - value) / (high - low))

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title, True)}">'
        f"<title>{escape(title)}</title>"
    ]
    for k in range(round((high - low) / step) + 1):
        value = low + k * step
        parts.append(
            f'<line class="grid" x1="{LEFT}" y1="{y_at(value):.1f}" x2="{WIDTH - RIGHT}" '
            f'y2="{y_at(value):.1f}"/>'
            f'<text x="{LEFT - 6}" y="{y_at(value) + 4:.1f}" text-anchor="end">'
            f"{0.0 if abs(value) < 1e-9 else value:.4g}</text>"
        )
    for j, name in enumerate(names):
        places = [(x_at(i), y_at(y)) for i, y in enumerate(values[:, j]) if np.isfinite(y)]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        # Joint j moves link j + 1 and has its colour.
        colour = link_colour(j + 1)
        dot = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colour}"/>' for x, y in places[:1])
        parts.append(
            f'<polyline points="{line}" fill="none" stroke="{colour}"><title>{escape(name)}</title>'
            f"</polyline>"
            f"{dot if len(places) == 1 else ''}"
            f'<circle cx="{WIDTH - RIGHT + 12}" cy="{TOP + 8 + 15 * j}" r="4" fill="{colour}"/>'
            f'<text x="{WIDTH - RIGHT + 20}" y="{TOP + 12 + 15 * j}">{escape(name)}</text>'
        )
    for i, anchor in ((0, "start"), (len(dates) - 1, "end")) if len(dates) > 1 else ((0, "start"),):
        day = escape(dates[i])
        parts.append(f'<text x="{x_at(i):.1f}" y="{HEIGHT - 6}" text-anchor="{anchor}">{day}</text>')
    parts.append(
        f'<text x="12" y="{TOP + depth / 2:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 12 {TOP + depth / 2:.0f})">{escape(unit)}</text></svg>'
    )
    return "".join(parts)
