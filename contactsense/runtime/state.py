"""What changes with a sample: observers, poses, hypotheses and candidates, in arrays that are reused for
every sample."""

from typing import NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses, SensorRows, empty_hypotheses, empty_rows
from contactsense.kinematics.model import Model, Motion, empty_motion
from contactsense.localization.candidate_buffers import Candidates, empty_candidates
from contactsense.localization.surface_cells import SurfaceCells, empty_surface_cells
from contactsense.residuals.bias_filter import BiasFilter, empty_bias_filter
from contactsense.residuals.friction_at_rest import FrictionAtRest, empty_friction_at_rest
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver, empty_observer, empty_observers
from contactsense.residuals.noise_scale import NoiseScale, empty_noise_scale
from contactsense.residuals.sensor_consistency import SensorConsistency, empty_consistency
from contactsense.residuals.timing_error import TimingError, empty_timing_error
from contactsense.runtime.constants import Constants
from contactsense.sensors.stream_state import StreamState, empty_stream_state
from contactsense.solvers.posterior import SearchBuffers, empty_search_buffers
from contactsense.tracking.contact_tracker import ContactTrack, empty_contact_track


class State(NamedTuple):
    """Everything that a sample changes: observers and the arrays that hold results."""

    model: Model
    """The arm's model with the masses that `bias_filter` has estimated."""
    torque_model: JointTorqueModel
    """The joint torque model with the biases that `bias_filter` has estimated."""
    bias_filter: BiasFilter
    """Filter for sensor biases and link masses."""
    friction_at_rest: FrictionAtRest
    """Reference torques of joints at rest."""
    motion: Motion
    hypotheses: Hypotheses
    candidates: Candidates
    search_buffers: SearchBuffers
    surface_cells: SurfaceCells
    link_probability: np.ndarray
    """Probability of each link, shape (links,)."""
    joint_observer: MomentumObserver
    """Residual of each joint torque, n equations."""
    base_observer: MomentumObserver
    """Residual of the base sensor in the frame of each body, 6 (n + 1) equations."""
    torque_difference: MomentumObserver
    """Residual of each joint torque minus the torque that the base wrench predicts, n equations."""
    link_observer: MomentumObserver
    """Residual of each of the S link sensors, base axes, S groups of six equations."""
    link_difference: MomentumObserver
    """Residual of each link sensor minus that of the base sensor, S groups of six equations."""
    track: ContactTrack
    """The current contact."""
    stream: StreamState
    """The newest sample and the state of its sensors."""
    consistency: SensorConsistency
    """Consistency of the sensors with the model and with each other."""
    noise_scale: NoiseScale
    """Noise of the sensors in units of the stated one."""
    timing_error: TimingError
    """Error of the torques' residuals due to the instants of the samples."""
    link_load: np.ndarray
    """Momentum and gravity wrench of the load on each link sensor, shape (S, 2, 6)."""
    link_origin: np.ndarray
    """Origin of each link sensor, base frame, shape (S, 3) [m]."""
    unbiased_wrench: np.ndarray
    """Scratch: base wrench minus its bias, shape (6,) [N, Nm]."""
    base_covariance: np.ndarray
    """Covariance of `base_wrench` from noise and model, divided by the residuals' variance ratio, shape (6,
    6)."""
    base_information: np.ndarray
    """Its inverse."""
    base_wrench: np.ndarray
    """External wrench on the base sensor, shape (6,) [N, Nm]."""
    body_wrench: np.ndarray
    """The same, low-passed in the frame of each body, shape (n + 1, 6)."""
    torque: np.ndarray
    """External part of each joint's torque as s_j . w, shape (n,) [Nm]."""
    proximal_torque: np.ndarray
    """The same for joints proximal to the contact, consistent with `base_wrench` while the arm moves, shape
    (n,)."""
    link_wrench: np.ndarray
    """External wrench on each link sensor, base axes, about the base origin, shape (S, 6) [N, Nm]."""
    proximal_link_wrench: np.ndarray
    """The same for contacts distal to the sensor, consistent with `base_wrench` while the arm moves, shape
    (S, 6)."""
    wrench_change: np.ndarray
    """Scratch: difference between the newest wrench and its window mean, shape (6,) [N, Nm]."""
    unmodelled_std: np.ndarray
    """Standard deviation of each joint torque's model and friction error, low-passed as the torque is, shape
    (n,) [Nm]."""
    torque_variance: np.ndarray
    """Variance of `torque` from noise and model, shape (n,) [Nm^2]."""
    link_variance: np.ndarray
    """Variance of each component of `link_wrench` about the sensor's origin, base axes, from noise and model,
    shape (S, 6) [N^2, Nm^2]."""
    link_mass_variance: np.ndarray
    """The part of it that is due to the masses that `bias_filter` estimates, shape (S, 6)."""
    rows: SensorRows
    """What joint torques and link sensors give to the link hypotheses, at most n + 6 S rows."""
    statistics: np.ndarray
    """Statistics of the residuals, see `contactsense.runtime.consistency_statistics`, shape (5,)."""
    zero_velocity: np.ndarray
    """Zero joint velocities, shape (n,)."""
    candidate_links: np.ndarray
    """1 for links on which the contact is searched, else 0, shape (links,), int64."""


def empty_state(constants: Constants) -> State:
    """State before the first sample."""
    joints = constants.model.joints
    links = len(constants.touchable)
    link_sensors = len(constants.link_sensors.body)
    return State(
        model=Model(*(array.copy() for array in constants.model)),
        torque_model=constants.torque_model._replace(bias=constants.torque_model.bias.copy()),
        bias_filter=empty_bias_filter(joints),
        friction_at_rest=empty_friction_at_rest(joints),
        motion=empty_motion(joints),
        hypotheses=empty_hypotheses(links),
        candidates=empty_candidates(len(constants.surfaces.kind)),
        search_buffers=empty_search_buffers(),
        surface_cells=empty_surface_cells(
            len(constants.samples.spread), len(constants.subsamples.spread), links
        ),
        link_probability=np.zeros(links),
        joint_observer=empty_observer(joints),
        base_observer=empty_observer(6 * (joints + 1)),
        torque_difference=empty_observer(joints),
        link_observer=empty_observers(link_sensors, 6),
        link_difference=empty_observers(link_sensors, 6),
        track=empty_contact_track(joints, link_sensors),
        stream=empty_stream_state(joints, link_sensors),
        consistency=empty_consistency(),
        noise_scale=empty_noise_scale(joints),
        timing_error=empty_timing_error(joints),
        link_load=np.zeros((link_sensors, 2, 6)),
        link_origin=np.zeros((link_sensors, 3)),
        unbiased_wrench=np.zeros(6),
        base_covariance=np.zeros((6, 6)),
        base_information=np.zeros((6, 6)),
        base_wrench=np.zeros(6),
        body_wrench=np.zeros((joints + 1, 6)),
        torque=np.zeros(joints),
        proximal_torque=np.zeros(joints),
        link_wrench=np.zeros((link_sensors, 6)),
        proximal_link_wrench=np.zeros((link_sensors, 6)),
        wrench_change=np.zeros(6),
        unmodelled_std=np.zeros(joints),
        torque_variance=np.zeros(joints),
        link_variance=np.zeros((link_sensors, 6)),
        link_mass_variance=np.zeros((link_sensors, 6)),
        rows=empty_rows(joints + 6 * link_sensors),
        statistics=np.zeros(5),
        zero_velocity=np.zeros(joints),
        candidate_links=np.zeros(links, dtype=np.int64),
    )
