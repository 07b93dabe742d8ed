"""Even motion along a curved surface between two knots of a path.

The nearest points of evenly spaced points of a chord are not evenly spaced on the surface. So the chord is
divided into steps, whose ways along the surface are summed, and each window gets the point of the chord that
lies at its fraction of the whole way.
"""

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, add_scaled, norm, vector
from contactsense.service.analysis.smoothing.path_arrays import STEPS, PathArrays

SHORT_CHORD = 0.01
"""Shorter chords are divided evenly: the curvature of a link makes no difference [m]."""


@kernel
def fill_chord_fractions(surfaces: Surfaces, link: int, path: PathArrays) -> None:
    """Fill `path.chord` for a path whose knots are on the surface."""
    last, done = path.places.shape[0] - 1, -1
    for w in range(path.knot.shape[0]):
        path.chord[w] = path.fraction[w]
        k = path.knot[w]
        if k >= last:
            continue
        begin = vector(path.places[k])
        chord = add_scaled(vector(path.places[k + 1]), -1.0, begin)
        if norm(chord) < SHORT_CHORD:
            continue
        if k != done:
            _measure_way(surfaces, link, path, begin, chord)
            done = k
        path.chord[w] = _chord_fraction(path, path.fraction[w] * path.way[STEPS])


@kernel
def _measure_way(surfaces: Surfaces, link: int, path: PathArrays, begin: Vector, chord: Vector) -> None:
    """Fill `path.way` with the way along the surface after each step of a chord."""
    path.way[0] = 0.0
    before = begin
    for i in range(1, STEPS + 1):
        on_chord = add_scaled(begin, i / STEPS, chord)
        _, _, point, _ = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], on_chord)
        path.way[i] = path.way[i - 1] + norm(add_scaled(point, -1.0, before))
        before = point


@kernel
def _chord_fraction(path: PathArrays, way: float) -> float:
    """Fraction of the chord after a way along the surface [m]."""
    i = 0
    while i < STEPS - 1 and path.way[i + 1] < way:
        i += 1
    step = path.way[i + 1] - path.way[i]
    part: float = (way - path.way[i]) / max(step, 1e-9)
    return (i + part) / STEPS
