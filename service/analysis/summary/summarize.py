"""Summary of a contact from its samples."""

from dataclasses import replace
from typing import Any

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.runtime.result_rows import (
    COVARIANCE,
    FORCE,
    LINK,
    NORMAL,
    POINT,
    POINT_BASE,
    PROBABILITY,
    TORSION,
)
from contactsense.scene import Scene
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact
from contactsense.service.analysis.summary.contact_summary import ContactSummary, ForceCurve
from contactsense.tracking.contact_track import NONE, SLIDE

TRANSIENT_TIME = 0.5
"""Contacts longer than this are quasi-static, shorter ones transient [s]."""
LEAST_EXPLAINED = 0.5
"""A contact is unexplained if samples with an explanation have less than this share of its energy: places
that explain its beginning and its end only, where the observers still follow, say nothing of its force."""
GAP = 0.05
"""Time without a known force that a force curve shows as a gap [s]."""
CURVE_POINTS = 400
"""Maximum number of points of a force curve."""


class Summarizer:
    """Summarizes the contacts of one scene."""

    def __init__(self, scene: Scene) -> None:
        """Prepare the arm's kinematics."""
        self._scene = scene
        self._model = build_model(scene.robot)
        self._motion = empty_motion(len(scene.robot.joints))

    def summarize(self, history: ContactHistory, recording: str) -> ContactSummary:
        """Summary from the live estimates: the link with the most force-weighted probability, and the most
        precise of its places."""
        frame, history = self._frame(history, recording), history.without_outages()
        rows = history.rows
        if history.explained_share < LEAST_EXPLAINED:
            return self._unexplained(history, frame)
        force = history.force
        peak = int(np.argmax(force))
        share = force**2 @ history.link_probability / np.sum(force**2)
        link = int(np.argmax(share))
        if not np.any(rows[:, LINK] == link):
            # Probable throughout, but never the most probable: no place on it is known.
            link = int(rows[peak, LINK])
        on_link = np.flatnonzero(rows[:, LINK] == link)
        spread = rows[on_link][:, COVARIANCE].reshape(-1, 3, 3).trace(axis1=1, axis2=2)
        best = rows[on_link[np.argmin(spread)]]
        at_peak = int(history.sample[peak])
        here, turn = self.link_pose(history.block.q[at_peak], link)
        there, turned = self.link_pose(history.block.q[history.sample[on_link[np.argmin(spread)]]], link)
        relative = turn @ turned.T
        point_base = here + relative @ (best[POINT_BASE] - there)
        return ContactSummary(
            **frame,
            link=self._scene.link_names[link],
            link_index=link,
            probability=float(best[PROBABILITY]),
            link_probability=share,
            point=best[POINT].copy(),
            point_base=point_base,
            normal_base=relative @ best[NORMAL],
            covariance=relative @ best[COVARIANCE].reshape(3, 3) @ relative.T,
            **_force_fields(history),
            speed=self.speed(history.block.q[0], history.block.qd[0], link, best[POINT]),
        )

    def with_place(
        self, contact: ContactSummary, history: ContactHistory, smoothed: SmoothedContact
    ) -> ContactSummary:
        """The summary with link and place from all samples of the contact, at the time of the largest force;
        the forces of `history` are those at that place."""
        best, link = smoothed.best, smoothed.best.link
        forces = _force_fields(history)
        q = forces["q"]
        (point,), (normal,), (covariance,) = smoothed.at(np.array([forces["peak_time"]]))
        origin, rotation = self.link_pose(q, min(link, len(q)))
        point_base = origin + rotation @ point
        frame_origin, frame = self.link_pose(q, link)
        place = (point_base - frame_origin) @ frame
        return replace(
            contact,
            **forces,
            link=self._scene.link_names[link],
            link_index=link,
            probability=float(smoothed.probability[0]),
            link_probability=smoothed.link_probability,
            point=place,
            point_base=point_base,
            normal_base=rotation @ normal,
            covariance=rotation @ covariance @ rotation.T,
            speed=self.speed(history.block.q[0], history.block.qd[0], link, place),
            slides=best.sliding,
            smoothed=True,
        )

    def link_pose(self, q: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
        """Origin (3,) [m] and rotation (3, 3) of a link's frame in the base frame."""
        forward_kinematics(self._model, q, self._motion)
        body = min(link, len(q))
        rotation, origin = self._motion.rotation[body].copy(), self._motion.origin[body].copy()
        if link > len(q):
            origin = origin + rotation @ self._scene.robot.flange_translation
            rotation = rotation @ self._scene.robot.flange_rotation
        return origin, rotation

    def speed(self, q: np.ndarray, qd: np.ndarray, link: int, point: np.ndarray) -> float:
        """Speed of a point of a link, link frame [m], at positions q [rad] and velocities qd [rad/s]: m/s."""
        origin, rotation = self.link_pose(q, link)
        place = origin + rotation @ point
        below = min(link, len(q))
        screw = self._motion.screw[:below]
        return float(np.linalg.norm(qd[:below] @ (screw[:, :3] + np.cross(screw[:, 3:], place))))

    def _frame(self, history: ContactHistory, recording: str) -> dict[str, Any]:
        """Fields that are known for every contact."""
        t = history.t
        return {
            "recording": recording,
            "row": int(history.row[0]),
            "row_end": int(history.row[-1]) + 1,
            "contact": history.contact,
            "begin": float(t[0]),
            "duration": float(t[-1] - t[0]),
            "complete": history.complete,
            "slides": bool(np.mean(history.phase == SLIDE) > 0.5),
            "energy": float(np.max(history.energy)),
            "silent": self._silent_time(history),
        }

    def _silent_time(self, history: ContactHistory) -> float:
        """Time before samples that lack one of the sensors of the scene [s]; those of a long contact are not
        equally far apart."""
        present = [self._scene.base_wrench is not None, self._scene.joint_torque is not None]
        lacking = ~history.usable[1:, present].all(axis=1)
        return float(np.diff(history.t)[lacking].sum())

    def _unexplained(self, history: ContactHistory, frame: dict[str, Any]) -> ContactSummary:
        """Summary of a contact that is not a single push on a touchable link."""
        force = np.linalg.norm(history.base_wrench[:, :3], axis=1)
        if self._scene.base_wrench is None:
            force = np.zeros(len(force))
        peak, nowhere = int(np.argmax(force)), np.full(3, np.nan)
        early = history.t - history.t[0] <= TRANSIENT_TIME
        return ContactSummary(
            **frame,
            link="",
            link_index=-1,
            probability=0.0,
            link_probability=np.zeros(len(self._scene.link_names)),
            point=nowhere,
            point_base=nowhere,
            normal_base=nowhere,
            covariance=np.full((3, 3), np.nan),
            force_base=history.base_wrench[peak, :3].copy() if force[peak] > 0.0 else nowhere,
            peak_force=float(force[peak]),
            peak_time=float(history.t[peak]),
            transient_force=float(np.max(force[early])),
            quasi_static_force=float(np.max(force[~early], initial=0.0)),
            impulse=float(np.trapezoid(force, history.t)),
            torsion=np.nan,
            speed=np.nan,
            q=history.block.q[peak].copy(),
            curve=_thinned(history.t, force),
        )


def _force_fields(history: ContactHistory) -> dict[str, Any]:
    """Fields that describe the force over time."""
    force, since = history.force, history.t[history.sample] - history.t[0]
    peak, early, curve = int(np.argmax(force)), since <= TRANSIENT_TIME, _force_curve(history)
    at_peak = int(history.sample[peak])
    return {
        "force_base": history.rows[peak, FORCE].copy(),
        "peak_force": float(force[peak]),
        "peak_time": float(history.t[at_peak]),
        "transient_force": float(np.max(force[early], initial=0.0)),
        "quasi_static_force": float(np.max(force[~early], initial=0.0)),
        "impulse": float(np.trapezoid(curve.force, curve.t)),
        "torsion": float(history.rows[peak, TORSION]),
        "q": history.block.q[at_peak].copy(),
        "curve": _thinned(curve.t, curve.force),
    }


def _force_curve(history: ContactHistory) -> ForceCurve:
    """Force over time; in a pause of the contact it is zero."""
    pause = np.flatnonzero(history.phase == NONE)
    sample = np.concatenate((history.sample, pause))
    force = np.concatenate((history.force, np.zeros(len(pause))))
    order = np.argsort(sample)
    return ForceCurve(history.t[sample[order]], force[order])


def _thinned(t: np.ndarray, force: np.ndarray) -> ForceCurve:
    """The largest force in each of about `CURVE_POINTS` intervals; NaN where it is not known for `GAP`."""
    step = np.diff(t)
    if len(step):
        gaps = np.flatnonzero(step > max(GAP, 3.0 * float(np.median(step)))) + 1
        t, force = np.insert(t, gaps, t[gaps]), np.insert(force, gaps, np.nan)
    size = max(1, -(-len(t) // CURVE_POINTS))
    starts = np.arange(0, len(t), size)
    return ForceCurve(t[starts].copy(), np.maximum.reduceat(force, starts))
