"""Lower limits of the error with given readings: oracles that know everything but the place of the contact.

An oracle uses the same windows of the same noisy readings, and knows the link, the surface and when the place
moves; force and torsion of every window and the sensors' biases remain unknown. The remaining unknown is a
shift of the place in the tangent plane: one for a contact that holds, one at the start and one at the end for
a contact that slides. The residuals are linear in it. With S the information of all windows about shift and
biases once force and torsion are eliminated, and g the gradient at the true place, the error is -S^-1 g: that
of the maximum of the posterior for a small distance from the truth, which holds by construction. Its
covariance S^-1 is the Cramér-Rao bound.

One oracle knows the real surface. The other one knows what the estimator knows: the scene's primitives and
their standard deviation from the real surface. Its place starts on the primitives at the point nearest to the
truth, with the normal there, and has unknown offsets along the normals with that prior; the distance of the
real surface from them is part of its error.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.motion.streams import Stream
from contactsense.robots.rotations import cross_matrix
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.smoothing.place_search import LinkMeasurement
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.solvers.posterior.contact_prior import Prior


@dataclass(frozen=True)
class Limit:
    """Error at the end of a contact."""

    error: float
    """Distance of the oracle's place from the true one, with the noise of the readings [m]; infinite where
    the place moves after the last window, so that no reading tells where to."""
    predicted: float
    """Square root of the trace of the bound on its covariance [m]."""


@dataclass(frozen=True)
class TruePath:
    """The true path of a contact in its link's frame."""

    point: np.ndarray
    """Place in each window, shape (W, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal of the real surface there, shape (W, 3)."""
    way: np.ndarray
    """Fraction of the slide that lies behind each window, shape (W,); zero for a contact that holds."""
    end: np.ndarray
    """Place at the end, shape (3,) [m]."""
    end_normal: np.ndarray
    """Normal there, shape (3,)."""
    end_way: float
    """Fraction of the slide at the end."""
    slides: bool
    """Whether the place moves."""
    force: float
    """Largest force [N]."""


def true_path(
    stream: Stream,
    history: ContactHistory,
    measured: LinkMeasurement,
    frames: Summarizer,
    end: int,
    slides: bool,
) -> TruePath:
    """The true path of one contact.

    Args:
        stream: The truth.
        history: The contact.
        measured: Measurements of its windows for a contact on the true link.
        frames: Link poses.
        end: Sample of the stream at which the place is evaluated.
        slides: Whether the place moves.
    """
    link = int(stream.link[end])
    touched = np.flatnonzero(stream.link == link)
    before = touched[np.searchsorted(touched, history.row[0], side="left") :]
    inside = before[before <= history.row[-1]]
    middle = history.row[np.searchsorted(history.t, measured.t).clip(max=len(history.row) - 1)]
    nearest = inside[np.searchsorted(inside, middle).clip(max=len(inside) - 1)]
    # All touched samples for the length of the slide, then the windows.
    points = np.array([_in_link(stream, frames, int(k), link)[0] for k in inside])
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    way = way / max(float(way[-1]), 1e-9) if slides else np.zeros(len(way))
    at = np.searchsorted(inside, nearest)
    last = min(int(np.searchsorted(inside, end)), len(inside) - 1)
    return TruePath(
        points[at],
        np.array([_in_link(stream, frames, int(k), link)[1] for k in nearest]),
        way[at],
        *_in_link(stream, frames, end, link),
        float(way[last]),
        slides,
        max(float(np.max(np.linalg.norm(stream.wrench[inside, :3], axis=1))), 1e-3),
    )


def smoothing_limit(
    path: TruePath,
    measured: LinkMeasurement,
    prior: Prior,
    surfaces: Surfaces | None = None,
    link: int = 0,
) -> Limit:
    """The oracle's error for one contact.

    Args:
        path: The truth.
        measured: Measurements of its windows for a contact on the true link.
        prior: Prior of contacts; those of the torsion and of the surface's offset are used.
        surfaces: Primitives of all links, for the oracle that knows only them; None: the real surface.
        link: The link.
    """
    if path.slides and path.end_way > 0.0 and not path.way.any():
        return Limit(np.inf, np.inf)
    places, normals = np.vstack((path.point, path.end)), np.vstack((path.normal, path.end_normal))
    height = np.zeros(len(places))
    if surfaces is not None:
        height, _, normals = distances(surfaces, places, link)
        places = places - height[:, None] * normals
    shifts = 6 if path.slides else 3
    offsets = 0 if surfaces is None else shifts // 3
    shared, biases = shifts + offsets, len(measured.bias_value)
    S, g = np.zeros((shared + biases, shared + biases)), np.zeros(shared + biases)
    S[shared:, shared:] = measured.bias_information + np.diag(1.0 / measured.bias_variance)
    g[shared:] = -measured.bias_value
    at = np.arange(shifts, shared)
    S[at, at] = prior.surface_deviation**-2

    def displacement(n: np.ndarray, way: float) -> np.ndarray:
        """Derivative of a place by shifts and offsets, shape (3, shared)."""
        share = np.array([1.0 - way, way])[: shifts // 3]
        tangential = np.eye(3) - np.outer(n, n)
        columns = [a * tangential for a in share] + [a * n[:, None] for a in share[:offsets]]
        return np.hstack(columns)

    for w in range(len(measured.t)):
        p, n = places[w], normals[w]
        L, a, M = (part[w] for part in measured.sums)
        G = np.zeros((6, 4))
        G[:3, :3], G[3:, :3], G[3:, 3] = np.eye(3), cross_matrix(p), n
        H = G.T @ L @ G
        H[3, 3] += 1.0 / (len(measured.t) * (prior.torsion_lever * path.force) ** 2)
        u = np.linalg.solve(H, G.T @ a)
        E = np.zeros((6, shared))
        E[3:] = -cross_matrix(u[:3]) @ displacement(n, path.way[w])
        g[:shared] -= E.T @ (a - L @ G @ u)
        g[shared:] += M.T @ G @ u
        J = np.hstack((G.T @ L @ E, G.T @ M))
        S[:shared, :shared] += E.T @ L @ E
        S[:shared, shared:] += E.T @ M
        S[shared:, :shared] += M.T @ E
        S -= J.T @ np.linalg.solve(H, J)
    # The shifts are tangential.
    for k, n in enumerate((normals[0], normals[-2])[: shifts // 3]):
        S[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += 1e12 * np.outer(n, n)
    rows = np.zeros((3, shared + biases))
    rows[:, :shared] = displacement(normals[-1], path.end_way)
    covariance = rows @ np.linalg.solve(S, rows.T)
    error = rows @ np.linalg.solve(S, -g) - height[-1] * normals[-1]
    return Limit(float(np.linalg.norm(error)), float(np.sqrt(np.trace(covariance))))


def _in_link(stream: Stream, frames: Summarizer, k: int, link: int) -> tuple[np.ndarray, np.ndarray]:
    """True place [m] and normal of a sample, in the link's frame."""
    origin, rotation = frames.link_pose(stream.q[k], link)
    return (stream.point_base[k] - origin) @ rotation, stream.normal_base[k] @ rotation
