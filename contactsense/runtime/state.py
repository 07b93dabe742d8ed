"""What changes with a sample: observers, poses, hypotheses and candidates, in arrays that are reused for
every sample."""

import math
from typing import Annotated, NamedTuple

from contactsense.isolation.link_hypotheses import Hypotheses, SensorRows
from contactsense.kinematics.model import Model, Motion
from contactsense.localization.candidates.candidate_buffers import MAX_CANDIDATES, Candidates
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.primitive_frames import PrimitiveFrames
from contactsense.residuals.bias_filter import BiasFilter
from contactsense.residuals.friction_at_rest import FrictionAtRest
from contactsense.residuals.inertia_torque import InertiaTorque
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver
from contactsense.residuals.noise_scale import NoiseScale, restart
from contactsense.residuals.observers import Observers
from contactsense.residuals.residual_ewma import ResidualEwma
from contactsense.residuals.sensor_consistency import SensorConsistency
from contactsense.residuals.timing_error import TimingError
from contactsense.residuals.velocity_noise import VelocityNoise
from contactsense.residuals.wrench_velocity_error import WrenchVelocityError
from contactsense.robots.jit.declaration import Floats, Integers, Sized
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.runtime.answer import Answer
from contactsense.scene_model.constants import Constants, sizes_of
from contactsense.sensors.stream_state import StreamState
from contactsense.solvers.posterior.contact_prior import SearchBuffers
from contactsense.tracking.contact_track import ContactTrack


class State(NamedTuple):
    """Everything that a sample changes: observers and the arrays that hold results."""

    model: Model
    """The arm's model with the masses that `bias_filter` has estimated."""
    torque_model: JointTorqueModel
    """The joint torque model with the biases and friction factors that `bias_filter` has estimated."""
    bias_filter: BiasFilter
    """Filter for sensor biases, friction factors and link masses."""
    friction_at_rest: FrictionAtRest
    """Reference torques of joints at rest."""
    motion: Motion
    hypotheses: Hypotheses
    candidates: Annotated[Candidates, Sized(candidates=f"max(primitives, {MAX_CANDIDATES})")]
    frames: PrimitiveFrames
    search_buffers: SearchBuffers
    surface_cells: Annotated[SurfaceCells, Sized(cells="samples + subsamples")]
    link_probability: Annotated[Floats, "links"]
    """Probability of each link."""
    answer: Answer
    """The newest answer of a kernel that Python calls for one sample."""
    observers: Observers
    ewma: ResidualEwma
    """Average of the residuals in a scene without a base sensor."""
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
    velocity_noise: VelocityNoise
    """Noise of the joint velocities, and sudden changes of the accelerations."""
    base_velocity_error: WrenchVelocityError
    """Error of the base wrench's residual due to the joint velocities."""
    link_velocity_error: Annotated[WrenchVelocityError, Sized("link_sensors")]
    """That of each link sensor's."""
    inertia_torque: InertiaTorque
    """Inertia torques, to which the torques' model error is in part proportional."""
    link_load: Annotated[Floats, "link_sensors, 2, 6"]
    """Momentum and gravity wrench of the load on each link sensor."""
    load_regressor: Annotated[MomentumObserver, Sized(equations="6 * link_sensors")]
    """What an error of the whole mass of that load would add to the wrench on a sensor that carries the tool
    alone; unused for others."""
    link_origin: Annotated[Floats, "link_sensors, 3"]
    """Origin of each link sensor, base frame [m]."""
    unbiased_wrench: Annotated[Floats, "6"]
    """Scratch: base wrench minus its bias [N, Nm]."""
    base_noise: Annotated[Floats, "6, 6"]
    """Covariance of white noise of the base wrench that would add as much to its residual as the noise of the
    sensor and the errors of the velocities together [N^2, N Nm, Nm^2]."""
    base_covariance: Annotated[Floats, "6, 6"]
    """Covariance of `base_wrench` from noise and model, divided by the residuals' variance ratio."""
    base_information: Annotated[Floats, "6, 6"]
    """Its inverse."""
    base_wrench: Annotated[Floats, "6"]
    """External wrench on the base sensor [N, Nm]."""
    body_wrench: Annotated[Floats, "joints + 1, 6"]
    """The same, low-passed in the frame of each body."""
    torque: Annotated[Floats, "joints"]
    """External part of each joint's torque as s_j . w [Nm]."""
    proximal_torque: Annotated[Floats, "joints"]
    """The same for joints proximal to the contact, consistent with `base_wrench` while the arm moves."""
    link_wrench: Annotated[Floats, "link_sensors, 6"]
    """External wrench on each link sensor, base axes, about the base origin [N, Nm]."""
    proximal_link_wrench: Annotated[Floats, "link_sensors, 6"]
    """The same for contacts distal to the sensor, consistent with `base_wrench` while the arm moves."""
    wrench_change: Annotated[Floats, "6"]
    """Scratch: difference between the newest wrench and its window mean [N, Nm]."""
    stream_unmodelled_std: Annotated[Floats, "joints"]
    """Standard deviation of each joint torque's model error in the stream, low-passed as the torque is
    [Nm]."""
    unmodelled_std: Annotated[Floats, "joints"]
    """That of `torque`: the same, or the one at rest for a single measurement [Nm]."""
    torque_variance: Annotated[Floats, "joints"]
    """Variance of `torque` from noise and model [Nm^2]."""
    link_row: Annotated[Floats, "link_sensors, 6, 6"]
    """Combinations of the components of each `link_wrench` whose errors, from noise and model, are
    uncorrelated, see `contactsense.kinematics.decorrelation`."""
    link_variance: Annotated[Floats, "link_sensors, 6"]
    """Their variances [N^2, Nm^2]."""
    link_model_covariance: Annotated[Floats, "link_sensors, 6, 6"]
    """Scratch: covariance of `link_wrench` from the model alone, base axes, base origin [N^2, N Nm, Nm^2]."""
    link_mass_covariance: Annotated[Floats, "link_sensors, 6, 6"]
    """The part of it that is due to the masses that `bias_filter` estimates."""
    rows: Annotated[SensorRows, Sized(rows="joints + 6 * link_sensors")]
    """What joint torques and link sensors give to the link hypotheses."""
    no_contact_energy: Annotated[Floats, "1"]
    """Energy of the no-contact hypothesis for the newest sample of the stream, on which detection depends."""
    statistics: Annotated[Floats, "4"]
    """What the sensor consistency monitor watches, see `contactsense.runtime.consistency_statistics`."""
    zero_velocity: Annotated[Floats, "joints"]
    """Zero joint velocities."""
    candidate_links: Annotated[Integers, "links"]
    """1 for links on which the contact is searched, else 0."""


def empty_state(constants: Constants) -> State:
    """State before the first sample."""
    state = zeros(State, **sizes_of(constants))
    state.track.status[0].last_body, state.track.status[0].time_since_end = -1, math.inf
    restart(state.noise_scale, constants.sensors.base_covariance)
    return state._replace(
        model=Model(*(array.copy() for array in constants.model)),
        torque_model=constants.torque_model._replace(
            bias=constants.torque_model.bias.copy(),
            friction_factor=constants.torque_model.friction_factor.copy(),
        ),
    )
