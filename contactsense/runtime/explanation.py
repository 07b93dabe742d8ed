"""Explain the residuals of one sample by a contact: link hypotheses, then the places on the links."""

import numpy as np

from contactsense.isolation.link_hypotheses import isolate
from contactsense.kinematics.spatial import dot6
from contactsense.localization.candidates.mixture_reduction import merge_overlapping
from contactsense.localization.problem.searched_surface import SearchArrays, SearchedSurface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.ranking import locate_contacts
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.surface.signed_distance_grid import Grids, Skin
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.candidate_rows import write_candidates
from contactsense.runtime.no_contact_hypothesis import update_covariances
from contactsense.runtime.sensor_rows import fill_rows
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.usable_sensors import Usable


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
    scene = searched_surface(constants)
    arrays = SearchArrays(state.search_buffers, state.surface_cells, state.candidates, state.frames)
    problem = SingleContactProblem(
        scene, state.candidate_links, state.motion, state.hypotheses, has_base, constants.prior
    )
    count = locate_contacts(problem, arrays, True, state.link_probability)
    if has_base:
        count = merge_overlapping(constants.surfaces, state.candidates, count)
    listed: int = write_candidates(constants, state, Grids(*skin), min(count, rows.shape[0]), rows)
    return listed, no_contact_energy


@inlined_kernel
def searched_surface(constants: Constants) -> SearchedSurface:
    """The surface of the scene's arm, as the searches for contacts take it."""
    return SearchedSurface(
        constants.surfaces,
        constants.samples,
        constants.surface_blocks,
        constants.subsamples,
        constants.deviations,
        constants.touchable,
        constants.left_out,
        constants.unmodelled,
        constants.sensors.depth,
    )
