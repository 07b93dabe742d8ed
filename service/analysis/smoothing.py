"""A second look at a contact once it is over: link and place from all of its samples together."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactsense import Localizer
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.runtime.constants import build_constants
from contactsense.runtime.result_rows import LINK, POINT_BASE
from contactsense.scene import Scene
from contactsense.service.analysis.contact_history import ContactHistory
from contactsense.service.analysis.contact_windows import ContactWindows, contact_windows
from contactsense.service.analysis.place_search import LinkMeasurement, Place, PlaceSearch
from contactsense.tracking.contact_tracker import SLIDE

APART = 0.03
"""Starts on one link are at least so far apart [m]."""
STARTS = 6
"""Most starts."""
LOOKS = (0.3, 0.5, 0.7, 0.9)
"""When a contact is looked at for starts, as parts of its duration."""
KNOT_TIME, MOST_KNOTS = 0.15, 12
"""Time between the places of a contact that slides [s], and the most of them."""
SLIDING_SHARE = 0.1
"""A contact that slides for this part of its time may move; so may one that does not fit a fixed place."""
LEAST_PROBABILITY = 0.01
"""Links that the live estimates of the contact's second half find less probable than this are left out."""
MISFIT = 6.0
"""An explanation fits while the squared residuals exceed their expectation by less than so many standard
deviations."""
HOPELESS = 200.0
"""Explanations whose energy is higher than the best one's by so much are not pursued."""


@dataclass(frozen=True, eq=False)
class SmoothedContact:
    """A contact as all of its samples tell it."""

    windows: ContactWindows
    """The measurements."""
    places: tuple[Place, ...]
    """Explanations, the most probable first."""
    probability: np.ndarray
    """Probability of each, shape (places,)."""
    link_probability: np.ndarray
    """Probability of each link, shape (links,)."""

    @property
    def best(self) -> Place:
        """The most probable explanation."""
        return self.places[0]

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Place of the best explanation at a time [s], link frame [m], outward normal and covariance
        [m^2]."""
        best, times = self.best, self.windows.t
        point = np.array([np.interp(t, times, column) for column in best.point.T])
        normal = np.array([np.interp(t, times, column) for column in best.normal.T])
        w = int(np.argmin(np.abs(times - t)))
        return point, normal / np.linalg.norm(normal), best.covariance[w]


class ContactSmoother:
    """For the contacts of one scene, which has no wrist sensor."""

    def __init__(self, scene: Scene) -> None:
        """Prepare for `scene`."""
        constants = build_constants(scene)
        # One of its own: `locate` would disturb a stream.
        self._scene, self._localizer = scene, Localizer(scene)
        self._surfaces, self._prior = constants.surfaces, constants.prior
        self._depth, self._sensors = constants.sensors.depth, constants.sensors
        self._model, self._motion = build_model(scene.robot), empty_motion(len(scene.robot.joints))

    def smooth(self, history: ContactHistory) -> SmoothedContact | None:
        """Look again at a contact; None where its samples allow no answer."""
        windows = contact_windows(history, self._scene.bandwidth)
        if windows is None or len(history.rows) == 0 or self._scene.wrist_wrench is not None:
            return None
        if not (np.isfinite(windows.base_wrench).all() and np.isfinite(windows.joint_torque).all()):
            return None
        duration = float(windows.t[-1] - windows.t[0])
        slides = bool(np.mean(history.phase == SLIDE) > SLIDING_SHARE)
        moving = min(int(duration / KNOT_TIME), MOST_KNOTS, len(windows.t) // 2)
        measured: dict[int, LinkMeasurement] = {}
        places: list[Place] = []
        lowest = np.inf
        for link, start in self._starts(history, windows):
            if link not in measured:
                measured[link] = self._measurement(history, windows, link)
            search = PlaceSearch(self._surfaces, link, self._prior, measured[link], 1)
            place = search.run(start, lowest + HOPELESS)
            if place is None or _is_duplicate(place, places):
                continue
            places.append(place)
            lowest = min(lowest, place.energy)
            if moving > 1 and (slides or place.energy > 0.5 * place.freedom):
                search = PlaceSearch(self._surfaces, link, self._prior, measured[link], moving)
                moved = search.run(place.point[0], lowest + HOPELESS)
                if moved is not None and not _is_duplicate(moved, places):
                    places.append(moved)
                    lowest = min(lowest, moved.energy)
        places = [place for place in places if _fits(place)]
        if not places:
            return None
        places.sort(key=lambda place: -place.log_evidence)
        weight = np.exp([place.log_evidence - places[0].log_evidence for place in places])
        probability = weight / weight.sum()
        link_probability = np.zeros(len(self._scene.link_names))
        np.add.at(link_probability, [place.link for place in places], probability)
        return SmoothedContact(windows, tuple(places), probability, link_probability)

    def _poses(
        self, windows: ContactWindows, body: int
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Origin, rotation and screws (n, 6) of a body's frame in each window."""
        for q in windows.q:
            forward_kinematics(self._model, q, self._motion)
            yield (
                self._motion.origin[body].copy(),
                self._motion.rotation[body].copy(),
                self._motion.screw.copy(),
            )

    def _measurement(self, history: ContactHistory, windows: ContactWindows, link: int) -> LinkMeasurement:
        """What the windows say of a contact on one link."""
        scene, body = self._scene, int(self._depth[link])
        count, joints = len(windows.t), windows.q.shape[1]
        root = np.sqrt(windows.samples)[:, None, None]
        step = float(np.median(np.diff(history.t)))
        gain = noise_variance_ratio(scene.bandwidth, step)
        X, S = np.zeros((count, 6, 6)), np.zeros((count, joints, 6))
        for w, (origin, rotation, screw) in enumerate(self._poses(windows, body)):
            X[w, :3, :3] = X[w, 3:, 3:] = rotation
            X[w, 3:, :3] = np.cross(origin, rotation.T).T
            S[w, :body] = screw[:body]
        values, matrices, biases, variances = [], [], [], []
        if scene.base_wrench is not None:
            C = self._sensors.base_covariance
            whiten = root * np.linalg.inv(np.linalg.cholesky(C))[None]
            values.append(np.einsum("wmk,wk->wm", whiten, windows.base_wrench))
            matrices.append(whiten @ X)
            biases.append(whiten)
            variances.append(np.mean(history.base_wrench_std**2, axis=0) - gain * np.diag(C))
        if scene.joint_torque is not None:
            noise = np.sqrt(self._sensors.torque_variance)
            whiten = root * np.diag(1.0 / noise)[None]
            values.append(np.einsum("wmk,wk->wm", whiten, windows.joint_torque))
            matrices.append(whiten @ S @ X)
            biases.append(whiten)
            variances.append(np.mean(history.joint_torque_std**2, axis=0) - gain * noise**2)
        bias = np.zeros((count, sum(b.shape[1] for b in biases), sum(b.shape[2] for b in biases)))
        row = 0
        for b in biases:
            bias[:, row : row + b.shape[1], row : row + b.shape[1]] = b
            row += b.shape[1]
        return LinkMeasurement(
            np.concatenate(values, axis=1),
            np.concatenate(matrices, axis=1),
            bias,
            np.maximum(np.concatenate(variances), 1e-8),
            windows.t,
        )

    def _starts(self, history: ContactHistory, windows: ContactWindows) -> list[tuple[int, np.ndarray]]:
        """Links and places, link frame, to search from: where the live estimates were, and what explains the
        mean of some windows."""
        found: list[tuple[int, np.ndarray]] = []

        # The live estimates weigh what can be reached at all; what they rule out stays out.
        late = history.link_probability[len(history.rows) // 2 :].mean(axis=0)

        def add(link: int, q: np.ndarray, point_base: np.ndarray) -> None:
            if late[link] < LEAST_PROBABILITY:
                return
            forward_kinematics(self._model, q, self._motion)
            body = int(self._depth[link])
            point = (point_base - self._motion.origin[body]) @ self._motion.rotation[body]
            near = any(link == one and np.linalg.norm(point - other) < APART for one, other in found)
            if not near and len(found) < STARTS:
                found.append((link, point))

        force = history.force
        order = np.argsort(-force)
        for k in (order[0], len(force) - 1 - int(np.argmax(force[::-1] > 0.8 * force.max()))):
            add(int(history.rows[k, LINK]), history.block.q[history.sample[k]], history.rows[k, POINT_BASE])
        count = len(windows.t)
        width = max(1, count // 8)
        for part in LOOKS:
            w = min(int(part * count), count - 1)
            few = slice(max(0, w - width), w + width + 1)
            if np.ptp(windows.q[few], axis=0).max() > 0.1:
                few = slice(w, w + 1)
            estimate = self._localizer.locate(
                windows.q[w],
                base_wrench=windows.base_wrench[few].mean(axis=0) if self._scene.base_wrench else None,
                joint_torque=-windows.joint_torque[few].mean(axis=0) if self._scene.joint_torque else None,
                detect=False,
            )
            for contact in estimate.contacts[:3]:
                add(contact.link_index, windows.q[w], contact.point_base)
        return found


def _fits(place: Place) -> bool:
    """Whether one contact at that place explains all of the windows: two contacts, one after the other, do
    not."""
    return bool(2.0 * place.energy < place.freedom + MISFIT * np.sqrt(2.0 * place.freedom))


def _is_duplicate(place: Place, others: list[Place]) -> bool:
    return any(
        place.link == other.link
        and place.sliding == other.sliding
        and float(np.max(np.linalg.norm(place.point - other.point, axis=1))) < 2e-3
        for other in others
    )
