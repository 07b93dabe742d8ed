"""Smoothing of a contact without a base sensor: link and place from the joint torques of the whole contact.

A window's torques measure fewer numbers than force and place have, so forces that are free in each window
would explain any place. Instead the contact is split into stretches in which the arm hardly turns and the
torques keep their direction, s_w tau. The magnitudes s_w are those of the best approximation of rank one
(singular value decomposition); with them the windows of a stretch are a single reading of tau with the noise
of all of its samples, which the localizer explains.

The noise of stretches is independent, but the same place, surface and direction of the push are behind all of
them: as evidence for a link, S stretches count as sqrt(S) independent ones, with the prior once. Places are
those of the stretch that is measured best, each with its share of the link's probability; in the other
stretches the place is the candidate nearest to it. The means over stretches were neither nearer to the truth
nor as certain as stated.

That each stretch is explained by some contact does not mean that one contact explains all: if another link is
touched later, most of all where two contacts overlap, the product names the link of the longer part, with a
high probability. So one link competes with a change of links (`link_changes`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from contactsense import Contact, Localizer
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, empty_motion
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.samples.contact_windows import ContactWindows
from contactsense.service.analysis.smoothing.goodness_of_fit import is_good_fit
from contactsense.service.analysis.smoothing.link_changes import log_odds_of_one_link
from contactsense.service.analysis.smoothing.place_search import Place
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact, ranked

LARGEST_TURN = 0.15
"""Maximum rotation of a joint within a stretch [rad]."""
MODEL_ERROR = 0.1
"""Part of the torques that one contact may leave unexplained, as the arm turns within a stretch."""
NEGLIGIBLE = 1e-12
"""Variance that makes covariances invertible [m^2]."""
DOUBT = 1e-3
"""Probability that a stretch says nothing about the link, as its contact is none that the model knows."""


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A candidate of one stretch, in the frame of its link."""

    probability: float
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Windows of a contact as a single reading."""

    windows: slice
    signal: float
    """Squared ratio of the torques to their noise."""
    ratio: np.ndarray
    """Probability of each link, divided by its prior; 1 where the prior is zero, shape (links,)."""
    contacts: tuple[Contact, ...]
    """Candidates."""
    q: np.ndarray
    """Joint positions [rad], shape (n,)."""

    def on(self, link: int) -> list[Contact]:
        """The candidates on a link."""
        return [contact for contact in self.contacts if contact.link_index == link]


class TorqueSmoother:
    """Smooths the contacts of one scene from the joint torques alone."""

    def __init__(self, localizer: Localizer, model: Model) -> None:
        """`localizer`: for single readings, each with noise of its own; `model`: its kinematics."""
        self._localizer, self._model = localizer, model
        self._constants = localizer.constants
        self._motion = empty_motion(len(localizer.scene.robot.joints))
        samples, surfaces = self._constants.samples, self._constants.surfaces
        links = len(localizer.scene.link_names)
        link = surfaces.link[samples.primitive]
        of_sample = np.exp(samples.log_share + self._constants.prior.log_link_density[link])
        self._prior = np.bincount(link, of_sample, minlength=links)

    def smooth(self, history: ContactHistory, windows: ContactWindows) -> SmoothedContact | None:
        """Smooth a contact; None if one contact does not explain it."""
        windows = self._with_onset(history, windows)
        stretches = self._stretches(history, windows)
        if stretches is None:
            return None
        ratio = np.array([stretch.ratio for stretch in stretches])
        if log_odds_of_one_link(self._prior, ratio) < 0.0:
            return None
        with np.errstate(divide="ignore"):
            evidence = np.log(self._prior) + np.log(ratio).sum(axis=0) / np.sqrt(len(stretches))
        places = [
            place
            for link in range(len(evidence))
            for place in self._places(link, float(evidence[link]), stretches, windows)
        ]
        return ranked(windows, places, len(evidence), jumps=True)

    def _with_onset(self, history: ContactHistory, windows: ContactWindows) -> ContactWindows:
        """The windows, preceded by the residual at which the contact was detected: that is the low-passed
        torque before, with the noise of the low-pass. Of a short impact it is most of what is known."""
        gain = self._noise_ratio(history)
        return replace(
            windows,
            t=np.concatenate((history.t[:1], windows.t)),
            samples=np.concatenate(([1.0 / gain], windows.samples)),
            q=np.concatenate((history.block.q[:1], windows.q)),
            joint_torque=np.concatenate((history.joint_torque[:1], windows.joint_torque)),
        )

    def _noise_ratio(self, history: ContactHistory) -> float:
        """Variance of a low-passed sample's noise over that of one sample."""
        return noise_variance_ratio(self._localizer.scene.bandwidth, float(np.median(np.diff(history.t))))

    def _stretches(self, history: ContactHistory, windows: ContactWindows) -> list[_Stretch] | None:
        """The stretches of a contact; None if one contact does not explain one of them."""
        noise = self._constants.sensors.torque_variance
        model_error = np.mean(history.joint_torque_std**2, axis=0) - self._noise_ratio(history) * noise
        offset = np.maximum(model_error, 0.0)
        found: list[_Stretch] = []
        waiting = [slice(0, len(windows.t))]
        while waiting:
            here = waiting.pop()
            scale, fits = _magnitudes(windows.joint_torque[here] / np.sqrt(noise), windows.samples[here])
            turns = np.ptp(windows.q[here], axis=0).max() > LARGEST_TURN
            if here.stop - here.start > 1 and (turns or not fits):
                middle = (here.start + here.stop) // 2
                waiting += [slice(middle, here.stop), slice(here.start, middle)]
                continue
            weight = windows.samples[here] * scale
            total = float(weight @ scale)
            if not total > 0.0:
                return None
            q = windows.q[(here.start + here.stop - 1) // 2]
            reading = weight @ windows.joint_torque[here] / total
            variance = noise / total + offset * (weight.sum() / total) ** 2
            with self._localizer.torque_variance(variance):
                estimate = self._localizer.locate(q, joint_torque=-reading, detect=False)
            if not any(self._explains(contact, q, reading, variance) for contact in estimate.contacts):
                return None
            signal, ratio = total * float(np.sum(reading**2 / noise)), self._ratio(estimate.link_probability)
            found.append(_Stretch(here, signal, ratio, estimate.contacts, q))
        return found

    def _ratio(self, probability: np.ndarray) -> np.ndarray:
        """Probability of each link over its prior, shape (links,)."""
        known = self._prior > 0.0
        ratio = np.divide(probability, self._prior * probability.sum(), out=np.ones(len(known)), where=known)
        return np.asarray(DOUBT + (1.0 - DOUBT) * ratio)

    def _explains(self, contact: Contact, q: np.ndarray, reading: np.ndarray, variance: np.ndarray) -> bool:
        """Whether a contact explains the torques, with noise of this variance."""
        forward_kinematics(self._model, q, self._motion)
        moment = np.cross(contact.point_base, contact.force_base) + contact.torsion * contact.normal_base
        torque = self._motion.screw @ np.concatenate((contact.force_base, moment))
        torque[int(self._constants.sensors.depth[contact.link_index]) :] = 0.0
        square, size = (float(np.sum(v**2 / variance)) for v in (reading - torque, reading))
        return is_good_fit(square, len(reading), MODEL_ERROR**2 * size)

    def _places(
        self, link: int, evidence: float, stretches: list[_Stretch], windows: ContactWindows
    ) -> list[Place]:
        """The places on a link, each followed through all stretches; none if no stretch has a candidate
        there."""
        there = [stretch for stretch in stretches if stretch.on(link)]
        if not there:
            return []
        first = max(range(len(there)), key=lambda k: there[k].signal)
        candidates = [[self._in_link_frame(c, stretch.q) for c in stretch.on(link)] for stretch in there]
        # Windows without a candidate on this link have that of the stretch nearest in time.
        begin, end = np.array([(part.windows.start, part.windows.stop - 1) for part in there]).T
        window = np.arange(len(windows.t))[:, None]
        nearest = np.argmin(np.maximum(begin - window, window - end), axis=1)
        total, found = sum(candidate.probability for candidate in candidates[first]), []
        for candidate in candidates[first]:
            path = [candidate]
            for others in candidates[first + 1 :]:
                path.append(_nearest(others, path[-1]))
            for others in candidates[first - 1 :: -1] if first else []:
                path.insert(0, _nearest(others, path[0]))
            share = math.log(candidate.probability / total)
            found.append(_followed(link, evidence + share, path, nearest))
        return found

    def _in_link_frame(self, contact: Contact, q: np.ndarray) -> "_Candidate":
        forward_kinematics(self._model, q, self._motion)
        body = int(self._constants.sensors.depth[contact.link_index])
        R, origin = self._motion.rotation[body], self._motion.origin[body]
        return _Candidate(
            contact.probability,
            (contact.point_base - origin) @ R,
            contact.normal_base @ R,
            contact.force_base @ R,
            R.T @ contact.covariance @ R,
        )


def _nearest(candidates: list[_Candidate], to: _Candidate) -> _Candidate:
    return min(candidates, key=lambda candidate: float(np.linalg.norm(candidate.point - to.point)))


def _followed(link: int, evidence: float, path: list[_Candidate], nearest: np.ndarray) -> Place:
    """A place through all windows; `nearest`: the stretch of each. It moves if its stretches disagree by more
    than their covariances."""
    points = np.array([candidate.point for candidate in path])
    information = np.linalg.inv(
        np.array([candidate.covariance for candidate in path]) + NEGLIGIBLE * np.eye(3)
    )
    mean = np.linalg.solve(information.sum(axis=0), np.einsum("sij,sj->i", information, points))
    away = points - mean
    square = float(np.einsum("si,sij,sj->", away, information, away))
    freedom = 3.0 * (len(path) - 1)
    fixed = is_good_fit(square, freedom)
    point, normal, force, covariance = (
        np.array([getattr(candidate, name) for candidate in path])[nearest]
        for name in ("point", "normal", "force", "covariance")
    )
    return Place(
        link, evidence, point, normal, force, covariance, points[:1] if fixed else points, 0.5 * square,
        freedom,
    )  # fmt: skip


def _magnitudes(torque: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, bool]:
    """Magnitudes of one direction in windows, mean square 1, and whether it explains them.

    Args:
        torque: Torques in units of a sample's noise, shape (W, n).
        samples: Samples of each window, shape (W,).
    """
    rows = np.sqrt(samples)[:, None] * torque
    _, values, directions = np.linalg.svd(rows, full_matrices=False)
    scale = torque @ directions[0]
    scale *= np.copysign(1.0, scale.sum()) / max(float(np.sqrt(np.mean(scale**2))), 1e-12)
    freedom = float((len(torque) - 1) * (torque.shape[1] - 1))
    square = float(np.sum(values[1:] ** 2))
    return scale, is_good_fit(square, freedom)
