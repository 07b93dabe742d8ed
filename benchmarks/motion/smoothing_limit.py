"""Lower limit of the error with given readings: an oracle that knows everything but the place of the contact.

It uses the same windows of the same noisy readings, and knows the link, the true surface (normal, no offset)
and when the place moves; force and torsion of every window and the sensors' biases remain unknown. The
remaining unknown is a shift of the place in the tangent plane: one for a contact that holds, one at the start
and one at the end for a contact that slides. The residuals are linear in it. With S the information of all
windows about shift and biases once force and torsion are eliminated, and g the gradient at the true place,
the error is -S^-1 g: that of the maximum of the posterior for a small distance from the truth, which holds by
construction. Its covariance S^-1 is the Cramér-Rao bound.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.motion.streams import Stream
from contactsense.localization.posterior import Prior
from contactsense.service.analysis.contact_history import ContactHistory
from contactsense.service.analysis.place_search import LinkMeasurement
from contactsense.service.analysis.summarize import Summarizer


@dataclass(frozen=True)
class Limit:
    """Error at the end of a contact."""

    error: float
    """Distance of the oracle's place from the true one, with the noise of the readings [m]."""
    predicted: float
    """Square root of the trace of the bound on its covariance [m]."""


def smoothing_limit(
    stream: Stream,
    history: ContactHistory,
    measured: LinkMeasurement,
    prior: Prior,
    frames: Summarizer,
    end: int,
    slides: bool,
) -> Limit:
    """The oracle's error for one contact.

    Args:
        stream: The truth.
        history: The contact.
        measured: Measurements of its windows for a contact on the true link.
        prior: Prior of contacts; only that of the torsion is used.
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
    # The truth in the link's frame: in all touched samples for the length of the slide, then in the windows.
    points = np.array([_in_link(stream, frames, int(k), link)[0] for k in inside])
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    way = way / max(float(way[-1]), 1e-9) if slides else np.zeros(len(way))
    at = np.searchsorted(inside, nearest)
    normals = np.array([_in_link(stream, frames, int(k), link)[1] for k in nearest])
    last = int(np.searchsorted(inside, end))
    end_normal = _in_link(stream, frames, end, link)[1]
    shifts = 6 if slides else 3
    biases = len(measured.bias_value)
    S, g = np.zeros((shifts + biases, shifts + biases)), np.zeros(shifts + biases)
    S[shifts:, shifts:] = measured.bias_information + np.diag(1.0 / measured.bias_variance)
    g[shifts:] = -measured.bias_value
    largest = max(float(np.max(np.linalg.norm(stream.wrench[inside, :3], axis=1))), 1e-3)
    for w in range(len(measured.t)):
        p, n = points[at[w]], normals[w]
        L, a, M = (part[w] for part in measured.sums)
        G = np.zeros((6, 4))
        G[:3, :3], G[3:, :3], G[3:, 3] = np.eye(3), _cross(p), n
        H = G.T @ L @ G
        H[3, 3] += 1.0 / (len(measured.t) * (prior.torsion_lever * largest) ** 2)
        u = np.linalg.solve(H, G.T @ a)
        tangential = np.eye(3) - np.outer(n, n)
        E = np.zeros((6, shifts))
        turn = -_cross(u[:3]) @ tangential
        E[3:, :3] = (1.0 - way[at[w]]) * turn
        E[3:, 3:] = way[at[w]] * turn if slides else 0.0
        g[:shifts] -= E.T @ (a - L @ G @ u)
        g[shifts:] += M.T @ G @ u
        J = np.hstack((G.T @ L @ E, G.T @ M))
        S[:shifts, :shifts] += E.T @ L @ E
        S[:shifts, shifts:] += E.T @ M
        S[shifts:, :shifts] += M.T @ E
        S -= J.T @ np.linalg.solve(H, J)
    # There is no shift along the normals.
    for k, n in enumerate((normals[0], normals[-1])[: shifts // 3]):
        S[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += 1e12 * np.outer(n, n)
    share = way[min(last, len(way) - 1)]
    tangential = np.eye(3) - np.outer(end_normal, end_normal)
    rows = np.zeros((3, shifts + biases))
    rows[:, :3] = (1.0 - share) * tangential
    if slides:
        rows[:, 3:6] = share * tangential
    covariance = rows @ np.linalg.solve(S, rows.T)
    error = rows @ np.linalg.solve(S, -g)
    return Limit(float(np.linalg.norm(error)), float(np.sqrt(np.trace(covariance))))


def _in_link(stream: Stream, frames: Summarizer, k: int, link: int) -> tuple[np.ndarray, np.ndarray]:
    """True place [m] and normal of a sample, in the link's frame."""
    origin, rotation = frames.link_pose(stream.q[k], link)
    return (stream.point_base[k] - origin) @ rotation, stream.normal_base[k] @ rotation


def _cross(v: np.ndarray) -> np.ndarray:
    """Matrix of the cross product v x, shape (3, 3)."""
    return np.cross(np.eye(3), v)
