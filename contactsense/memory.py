"""What a sample changes: observers, poses, hypotheses and explanations, in arrays that are filled again and
again."""

from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm
from contactsense.candidates import Candidates, empty_candidates
from contactsense.cells import Cells, empty_cells
from contactsense.drive import Drive
from contactsense.energy import Work, empty_work
from contactsense.follower import Follower, empty_follower
from contactsense.health import Health, empty_health
from contactsense.isolation import Hypotheses, empty_hypotheses
from contactsense.observer import Observer, empty_observer
from contactsense.stiction import Stiction, empty_stiction
from contactsense.stream import Stream, empty_stream
from contactsense.tracker import Track, empty_track
from kinematics.model import Model, Motion, empty_motion


class Memory(NamedTuple):
    """Everything that a sample changes: observers, and the arrays in which results are left."""

    model: Model
    """The arm's, with masses as `follower` has them."""
    drive: Drive
    """The arm's, with biases as `follower` has them."""
    follower: Follower
    """What is not known of sensors and masses."""
    stiction: Stiction
    """What is known of the torques that resting joints take."""
    motion: Motion
    hypotheses: Hypotheses
    found: Candidates
    work: Work
    cells: Cells
    link_probability: np.ndarray
    """Probability of each link, shape (links,)."""
    joints: Observer
    """What each joint's torque sees, n equations."""
    base: Observer
    """What the base sensor sees, in the frame of each body, 6 (n + 1) equations."""
    match: Observer
    """What each joint's torque sees beyond the base sensor, n equations."""
    wrist: Observer
    """What the wrist sensor sees, base axes, six equations."""
    wrist_match: Observer
    """What it sees beyond the base sensor, six equations."""
    track: Track
    """The contact that is on."""
    stream: Stream
    """The newest sample, and what its sensors are good for."""
    health: Health
    """Whether model and sensors still fit."""
    carried: np.ndarray
    """Momentum and gravity wrench of what the wrist sensor carries, shape (2, 6)."""
    wrist_origin: np.ndarray
    """Origin of the wrist sensor, base frame, shape (3,) [m]."""
    reading: np.ndarray
    """Scratch: base wrench less its bias, shape (6,) [N, Nm]."""
    base_covariance: np.ndarray
    """Covariance of `base_wrench`, noise and model, over the factor on the noise, shape (6, 6)."""
    base_information: np.ndarray
    """Its inverse."""
    base_wrench: np.ndarray
    """External wrench on the base sensor, shape (6,) [N, Nm]."""
    body_wrench: np.ndarray
    """The same as followed in the frame of each body, shape (n + 1, 6)."""
    torque: np.ndarray
    """External part of each joint's torque as s_j . w, shape (n,) [Nm]."""
    seen_torque: np.ndarray
    """The same as held against `base_wrench` where the joint sees the contact, shape (n,)."""
    wrist_wrench: np.ndarray
    """External wrench on the wrist sensor, base axes, base origin, shape (6,) [N, Nm]."""
    seen_wrist: np.ndarray
    """The same as held against `base_wrench` where the sensor sees the contact, shape (6,)."""
    change: np.ndarray
    """Scratch: what a wrench has changed since its mean, shape (6,) [N, Nm]."""
    unexplained: np.ndarray
    """What model and friction leave of each joint's torque, standard deviation, filtered as the torque is,
    shape (n,) [Nm]."""
    torque_variance: np.ndarray
    """Variance of `torque`, noise and model, shape (n,) [Nm^2]."""
    fit: np.ndarray
    """How well residuals fit what is known, see `contactsense.fit`, shape (5,)."""
    rest: np.ndarray
    """Zero joint velocities, shape (n,)."""
    open: np.ndarray
    """Links among which the contact is sought: 1, else 0, shape (links,), int64."""


def empty_memory(arm: Arm) -> Memory:
    """Memory before the first sample."""
    joints = arm.model.joints
    links = len(arm.touchable)
    return Memory(
        model=Model(*(array.copy() for array in arm.model)),
        drive=arm.drive._replace(bias=arm.drive.bias.copy()),
        follower=empty_follower(joints),
        stiction=empty_stiction(joints),
        motion=empty_motion(joints),
        hypotheses=empty_hypotheses(links),
        found=empty_candidates(len(arm.surfaces.kind)),
        work=empty_work(),
        cells=empty_cells(len(arm.places.spread), len(arm.parts.spread), links),
        link_probability=np.zeros(links),
        joints=empty_observer(joints),
        base=empty_observer(6 * (joints + 1)),
        match=empty_observer(joints),
        wrist=empty_observer(6),
        wrist_match=empty_observer(6),
        track=empty_track(joints),
        stream=empty_stream(joints),
        health=empty_health(),
        carried=np.zeros((2, 6)),
        wrist_origin=np.zeros(3),
        reading=np.zeros(6),
        base_covariance=np.zeros((6, 6)),
        base_information=np.zeros((6, 6)),
        base_wrench=np.zeros(6),
        body_wrench=np.zeros((joints + 1, 6)),
        torque=np.zeros(joints),
        seen_torque=np.zeros(joints),
        wrist_wrench=np.zeros(6),
        seen_wrist=np.zeros(6),
        change=np.zeros(6),
        unexplained=np.zeros(joints),
        torque_variance=np.zeros(joints),
        fit=np.zeros(5),
        rest=np.zeros(joints),
        open=np.zeros(links, dtype=np.int64),
    )
