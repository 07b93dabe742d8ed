"""Smoothing of a contact after its end: link and place from all of its samples together."""

from dataclasses import replace

import numpy as np

from contactsense import Localizer
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.runtime.result_rows import LINK, POINT_BASE
from contactsense.scene import Scene
from contactsense.scene_model.skin_grids import skin_of
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.samples.contact_windows import ContactWindows, contact_windows
from contactsense.service.analysis.samples.link_windows import link_windows
from contactsense.service.analysis.smoothing.curved_regions import curvature_covariance
from contactsense.service.analysis.smoothing.path_arrays import WindowSums
from contactsense.service.analysis.smoothing.path_mixture import mixture, moving_paths
from contactsense.service.analysis.smoothing.place_accessibility import log_accessible_share
from contactsense.service.analysis.smoothing.place_forces import with_forces_at_place
from contactsense.service.analysis.smoothing.place_search import LinkMeasurement, Place, PlaceSearch
from contactsense.service.analysis.smoothing.skin_constraint import place_on_skin
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact, ranked
from contactsense.service.analysis.smoothing.torque_smoothing import TorqueSmoother

APART = 0.03
"""Minimum distance of starting points on one link [m]."""
STARTS = 6
"""Maximum number of starting points."""
LOOKS = (0.3, 0.5, 0.7, 0.9)
"""Times at which starting points are taken from a contact, as fractions of its duration."""
TRACK = 4
"""Number of live estimates from which the search for a moving path starts."""
LEAST_PROBABILITY = 0.01
"""Links that are less probable than this in the live estimates of the contact's second half are left out."""
HOPELESS = 200.0
"""Explanations whose energy exceeds that of the best one by this much are dropped."""


class ContactSmoother:
    """Smooths the contacts of one scene, except those beyond a force/torque sensor within the arm."""

    def __init__(self, scene: Scene) -> None:
        """Prepare for `scene`."""
        # A separate localizer: that of the recording is between two blocks. Its constants are used, as they
        # take long to build.
        self._scene, self._localizer = scene, Localizer(scene)
        constants = self._localizer.constants
        self._surfaces, self._deviations = constants.surfaces, constants.deviations
        self._prior = constants.prior
        self._depth, self._sensors = constants.sensors.depth, constants.sensors
        self._skin = skin_of(scene)
        self._model, self._motion = build_model(scene.robot), empty_motion(len(scene.robot.joints))
        self._torques = TorqueSmoother(self._localizer, self._model)

    def smooth(self, history: ContactHistory) -> SmoothedContact | None:
        """Smooth a contact; None if its samples allow no result."""
        windows = contact_windows(history, self._scene.bandwidth)
        if windows is None or len(history.rows) == 0 or self._is_beyond_link_sensor(history):
            return None
        if not (np.isfinite(windows.base_wrench).all() and np.isfinite(windows.joint_torque).all()):
            return None
        if self._scene.base_wrench is None:
            return self._torques.smooth(history, windows)
        measured: dict[int, LinkMeasurement] = {}
        found: list[Place] = []
        places: list[Place] = []
        lowest = np.inf
        for link, start in self._starts(history, windows):
            if link not in measured:
                measured[link] = self.measurement(history, windows, link)
            place = PlaceSearch(self._surfaces, link, self._prior, measured[link], measured[link].t[:1]).run(
                start, lowest + HOPELESS
            )
            if place is None or _is_duplicate(place, found):
                continue
            found.append(place)
            lowest = min(lowest, place.energy)
            paths = moving_paths(
                self._surfaces, link, self._prior, measured[link], place.knots, place.log_evidence
            )
            places += self._explanation([[place], *paths], windows)
        # A contact that slides far fits no fixed place from the start; the live estimates have followed it.
        for link in set(measured) - {place.link for place in places}:
            track = self._track(history, link)
            if track is not None:
                paths = moving_paths(self._surfaces, link, self._prior, measured[link], track)
                places += self._explanation([*paths], windows)
        return ranked(windows, distinct(places), len(self._scene.link_names))

    def with_forces(self, history: ContactHistory, smoothed: SmoothedContact) -> ContactHistory:
        """A contact with the forces that belong to the place which `smooth` has found."""
        if self._scene.base_wrench is not None:
            return history
        return with_forces_at_place(history, smoothed, self._model, self._localizer.constants)

    def _is_beyond_link_sensor(self, history: ContactHistory) -> bool:
        """Whether the live estimates leave it open that something beyond a link sensor was touched. If not,
        that sensor measures nothing of the contact."""
        first = self._sensors.first_link
        if len(first) == 0:
            return False
        late = history.link_probability[len(history.rows) // 2 :].mean(axis=0)
        return bool(late[int(first.min()) :].sum() >= LEAST_PROBABILITY)

    def _explanation(self, paths: list[list[Place]], windows: ContactWindows) -> list[Place]:
        """The paths that fit, combined into one place; empty if no path fits. `paths`: those of each number
        of knots."""
        place = mixture(paths)
        return [] if place is None else [self._curved(self._touchable(place, windows))]

    def _curved(self, place: Place) -> Place:
        """The place on the skin, if the scene has one, with the covariance that the surface's curvature
        adds."""
        found = place_on_skin(self._skin, place)
        more = curvature_covariance(
            self._surfaces, self._skin, place.link, found.point, place.normal, found.covariance
        )
        return replace(found, covariance=found.covariance + more)

    def _track(self, history: ContactHistory, link: int) -> np.ndarray | None:
        """Positions of the live estimates on a link, body frame, at `TRACK` times; None if there are few."""
        on = np.flatnonzero(history.rows[:, LINK] == link)
        if len(on) < max(len(history.rows) // 4, TRACK):
            return None
        body, points = int(self._depth[link]), []
        for part in np.array_split(on, TRACK):
            k = part[len(part) // 2]
            forward_kinematics(self._model, history.block.q[history.sample[k]], self._motion)
            base = history.rows[k, POINT_BASE]
            points.append((base - self._motion.origin[body]) @ self._motion.rotation[body])
        return np.array(points)

    def _touchable(self, place: Place, windows: ContactWindows) -> Place:
        """The place with the evidence that it can be touched at the start, middle and end of the contact."""
        shares = []
        for w in {0, len(windows.t) // 2, len(windows.t) - 1}:
            forward_kinematics(self._model, windows.q[w], self._motion)
            shares.append(
                log_accessible_share(
                    self._surfaces,
                    self._deviations,
                    self._prior,
                    place.link,
                    place.point[w],
                    place.covariance[w],
                    self._depth,
                    self._motion,
                )
            )
        return replace(place, log_evidence=place.log_evidence + min(shares))

    def measurement(self, history: ContactHistory, windows: ContactWindows, link: int) -> LinkMeasurement:
        """Measurements of the windows for a contact on one link."""
        scene = self._scene
        found = link_windows(self._model, history, windows, scene.bandwidth, int(self._depth[link]))
        gain = noise_variance_ratio(scene.bandwidth, float(np.median(np.diff(history.t))))
        C, X = self._sensors.base_covariance, found.transform
        information, samples = np.linalg.inv(C), windows.samples
        y = np.einsum("wij,wj->wi", X, found.wrench)
        weighted = samples[:, None, None] * np.swapaxes(X, 1, 2) @ information
        L, a, M = weighted @ X, np.einsum("wij,wj->wi", weighted, y), weighted
        N, d = samples.sum() * information, information @ (samples @ y)
        square = float(np.einsum("w,wi,ij,wj->", samples, y, information, y))
        variance = np.mean(history.base_wrench_std**2, axis=0) - gain * np.diag(C)
        rows = y.size
        if scene.joint_torque is not None:
            precision = 1.0 / self._sensors.torque_variance
            A, y = found.screw @ X, found.torque
            weighted = samples[:, None, None] * np.swapaxes(A, 1, 2) * precision
            L, a = L + weighted @ A, a + np.einsum("wij,wj->wi", weighted, y)
            M = np.concatenate((M, weighted), axis=2)
            corner = np.zeros((6, len(precision)))
            N = np.block([[N, corner], [corner.T, samples.sum() * np.diag(precision)]])
            d = np.concatenate((d, precision * (samples @ y)))
            square += float(np.einsum("w,wi,i->", samples, y * y, precision))
            more = np.mean(history.joint_torque_std**2, axis=0) - gain / precision
            variance = np.concatenate((variance, more))
            rows += y.size
        return LinkMeasurement(
            WindowSums(L, a, np.ascontiguousarray(M)),
            N,
            d,
            np.maximum(variance, 1e-8),
            square,
            rows,
            windows.weighted_t,
        )

    def _starts(self, history: ContactHistory, windows: ContactWindows) -> list[tuple[int, np.ndarray]]:
        """Links and starting points of the search, link frame: those of the live estimates, and those that
        explain the mean of some windows."""
        found: list[tuple[int, np.ndarray]] = []

        # The live estimates take into account what can be reached; places that they rule out are not tried.
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
                base_wrench=windows.base_wrench[few].mean(axis=0),
                joint_torque=-windows.joint_torque[few].mean(axis=0) if self._scene.joint_torque else None,
                detect=False,
            )
            for contact in estimate.contacts[:3]:
                add(contact.link_index, windows.q[w], contact.point_base)
        return found


def distinct(places: list[Place]) -> list[Place]:
    """The places without those that another one with more evidence repeats: searches from different points
    may end on the same path."""
    found: list[Place] = []
    for place in sorted(places, key=lambda place: -place.log_evidence):
        if not _is_duplicate(place, found):
            found.append(place)
    return found


def _is_duplicate(place: Place, others: list[Place]) -> bool:
    return any(
        place.link == other.link and float(np.max(np.linalg.norm(place.point - other.point, axis=1))) < 2e-3
        for other in others
    )
