"""Explain the residuals of one sample by a contact: link hypotheses, then the places on the links."""

from typing import TypeAlias

import numpy as np

from contactsense.isolation.link_hypotheses import isolate
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.localization.mixture_reduction import merge_overlapping
from contactsense.localization.ranking import locate_contacts
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.surface.signed_distance_grid import Grids, Skin
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.candidate_rows import write_candidates
from contactsense.runtime.constants import Constants
from contactsense.runtime.no_contact_hypothesis import update_covariances
from contactsense.runtime.residual_update import update_link_sensors
from contactsense.runtime.sensor_rows import fill_rows
from contactsense.runtime.state import State
from contactsense.sensors.usable_sensors import Usable

Measured: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Joint positions [rad] and torques [Nm], shape (n,), base wrench (6,) and wrenches on the link sensors (S,
6) [N, Nm]; any values for sensors that have not measured. A plain tuple: Numba takes longer to recognize a
named one."""


@inlined_kernel
def take_static_sample(
    constants: Constants,
    state: State,
    measured: Measured,
    external: bool,
) -> None:
    """Fill `state` from one sample of an arm at rest: poses and `take_static_residuals`."""
    q = measured[0]
    kinematics_and_momenta(constants.model, q, state.zero_velocity, constants.gravity, state.motion)
    take_static_residuals(constants, state, measured, external)


@inlined_kernel
def take_static_residuals(
    constants: Constants,
    state: State,
    measured: Measured,
    external: bool,
) -> None:
    """Fill `state` with the residuals of one sample of an arm at rest, whose poses it has.

    With `external` the arm's weight has been subtracted from the measurements already; joint torques keep the
    actuator's sign, so that a contact wrench w adds -s_j . w to them.
    """
    motion = state.motion
    q, torque, base_wrench, link_wrench = measured
    update_link_sensors(constants, state)
    for j in range(q.shape[0]):
        model_torque = constants.torque_model.bias[j] - constants.torque_model.gravity * dot6(
            motion.screw[j], motion.gravity[j + 1]
        )
        state.torque[j] = (0.0 if external else model_torque) - torque[j]
        state.unmodelled_std[j] = unmodelled_torque_std(constants.torque_model, j, 0.0)
    for i in range(6):
        state.base_wrench[i] = base_wrench[i] - (0.0 if external else motion.gravity[0, i])
    state.bias_filter.base_covariance[:] = 0.0
    state.bias_filter.torque_variance[:] = 0.0
    state.link_mass_variance[:] = 0.0
    state.timing_error.variance[:] = 0.0
    state.inertia_torque.present[:] = 0.0
    for i in range(len(state.noise_scale.noise)):
        state.noise_scale.noise[i].scale = 1.0
    for body in range(state.body_wrench.shape[0]):
        copy(state.base_wrench, state.body_wrench[body])
    copy(state.torque, state.proximal_torque)
    for s in range(link_wrench.shape[0]):
        for i in range(6):
            state.link_wrench[s, i] = link_wrench[s, i] - (0.0 if external else state.link_load[s, 1, i])
            state.proximal_link_wrench[s, i] = state.link_wrench[s, i]


@inlined_kernel
def isolate_links(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    link_sensors: int,
    variance_ratio: float,
) -> float:
    """Fused wrench and evidence of each link hypothesis, in `State.hypotheses`.

    Arguments as for `explain_sample`.

    Returns:
        Energy of the no-contact hypothesis: half the squared residuals in units of the noise.
    """
    update_covariances(constants, state, variance_ratio)
    count = fill_rows(constants, state, has_torque, link_sensors)
    isolate(
        state.base_covariance,
        state.base_information,
        state.base_wrench,
        has_base,
        state.rows,
        count,
        variance_ratio,
        state.hypotheses,
    )
    # A contact on the base link loads the base sensor only: the joints' part of its energy is that of no
    # contact.
    no_contact_energy = state.hypotheses.energy[0]
    if has_base:
        for i in range(6):
            row = dot6(state.base_information[i], state.base_wrench)
            no_contact_energy += 0.5 * state.base_wrench[i] * row / variance_ratio
        for link in range(1, constants.touchable.shape[0]):
            for i in range(6):
                state.hypotheses.wrench[link, i] += (
                    state.body_wrench[constants.sensors.depth[link], i] - state.base_wrench[i]
                )
    return float(no_contact_energy)


@inlined_kernel
def most_probable_link(constants: Constants, state: State) -> int:
    """The touchable link of highest evidence after `isolate_links`; -1 if no link can be touched."""
    best = -1
    for link in range(constants.touchable.shape[0]):
        if constants.touchable[link] and (
            best < 0 or state.hypotheses.log_evidence[link] > state.hypotheses.log_evidence[best]
        ):
            best = link
    return best


@kernel
def explain_sample(
    buffers: Buffers,
    skin: Skin,
    usable: Usable,
    variance_ratio: float,
    link_first: bool,
    threshold: float,
    rows: np.ndarray,
) -> tuple[int, float]:
    """Explain the residuals in `State` by one contact, and list the candidates.

    All ways to an estimate share this code, which is compiled once: so it takes the buffers.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`, with poses and residuals. Candidates
            and `link_probability` are filled.
        skin: The fields of `contactsense.robots.surface.signed_distance_grid.Grids`, as a plain tuple.
        usable: Which sensors have measured.
        variance_ratio: Variance of the residuals over that of one sample's noise.
        link_first: Choose the link of highest evidence first and search on that link only.
        threshold: No candidates are computed if the energy of the no-contact hypothesis is not above this.
        rows: Filled with the candidates, as many as there are rows at most.

    Returns:
        Number of candidates in `rows`, and the energy of the no-contact hypothesis: half the squared
        residuals in units of the noise.
    """
    constants, state = buffer_views(buffers)
    has_base, has_torque, link_sensors = usable
    no_contact_energy = isolate_links(constants, state, has_base, has_torque, link_sensors, variance_ratio)
    if no_contact_energy <= threshold:
        return 0, no_contact_energy
    for link in range(constants.touchable.shape[0]):
        state.candidate_links[link] = 0 if link_first else constants.touchable[link]
    if link_first:
        best = most_probable_link(constants, state)
        if best >= 0:
            state.candidate_links[best] = 1
    scene = SearchedSurface(
        constants.surfaces,
        constants.samples,
        constants.surface_blocks,
        constants.subsamples,
        constants.deviations,
        constants.touchable,
        constants.left_out,
        constants.sensors.depth,
    )
    arrays = SearchArrays(state.search_buffers, state.surface_cells, state.candidates)
    count = locate_contacts(
        scene,
        state.candidate_links,
        state.motion,
        state.hypotheses,
        has_base,
        constants.prior,
        arrays,
        state.link_probability,
    )
    if has_base:
        count = merge_overlapping(constants.surfaces, state.candidates, count)
    listed: int = write_candidates(constants, state, Grids(*skin), min(count, rows.shape[0]), rows)
    return listed, no_contact_energy
