"""The compiled entry point of the search for several contacts."""

import math

import numpy as np

from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.surface.primitive_frames import place_primitives
from contactsense.multi_contact.contact_set_search import Sought, search_contact_sets
from contactsense.multi_contact.further_contact import SingleContactSearch
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel, transform_samples
from contactsense.multi_contact.measurement_rows import Variances, fill_measurement_rows, rank_of
from contactsense.multi_contact.memory.buffers import Measurement, MultiContactBuffers
from contactsense.multi_contact.seeding.seeding_prior import estimate_force_scale
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.signed_distance_grid import Grids, Skin
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.candidate_rows import MIN_REPORTED_PROBABILITY, CandidateRow, write_row
from contactsense.runtime.explanation import searched_surface
from contactsense.runtime.no_contact_hypothesis import update_covariances
from contactsense.runtime.residual_update import residual_variance_ratio
from contactsense.sensors.usable_sensors import Usable


@kernel
def explain_contact_sets(
    kernel_buffers: Buffers,
    skin: Skin,
    buffers: MultiContactBuffers,
    present: Usable,
    bandwidth: float,
    known_count: int,
    drift: float,
    max_contacts: int,
    rows: np.ndarray,
) -> tuple[int, int]:
    """Explain the sample last taken by sets of simultaneous contacts.

    Args:
        kernel_buffers, skin: The localizer's kernel buffers after
            `contactsense.runtime.kernels.process`, and the signed distance grids.
        buffers: With the known contacts filled in.
        present: Which sensors have measured.
        bandwidth: Cut-off frequency of the observers [Hz]; infinite for an arm at rest, whose external
            wrench and torques are not filtered.
        known_count, drift: Number of known contacts, and standard deviation of the change of each component
            of their forces [N]; infinity: their forces are new ones.
        max_contacts: Maximum number of contacts, the known ones included.
        rows: Filled: the contacts of the best explanation, then those of the next one, as in
            `contactsense.runtime.result_rows`, shape (MAX_EXPLANATIONS * MAX_CONTACTS, WIDTH).

    Returns:
        Number of explanations above the minimum probability, and number of independent measurements of the
        wrenches of the first one.
    """
    constants, state = buffer_views(kernel_buffers)
    scale, lag = 1.0, 0.0
    external = (state.base_wrench, state.torque, state.link_wrench)
    if bandwidth < math.inf:
        # The residuals of the observers, not their averages for a single contact.
        lag = 1.0 / (2.0 * math.pi * bandwidth)
        external = (
            state.observers.base.residual[:6],
            state.observers.joints.residual,
            state.observers.links.residual,
        )
        scale = residual_variance_ratio(state, present)
    update_covariances(constants, state, scale)
    depth, seed_samples, explanations = constants.sensors.depth, buffers.seed_samples, buffers.explanations
    place_primitives(constants.surfaces, depth, state.motion, state.frames)
    transform_samples(constants.samples, depth, state.motion, seed_samples, buffers.seeding)
    variances = Variances(
        state.base_information, scale, state.torque_variance, state.link_row, state.link_variance
    )
    measurement = Measurement(
        buffers.rows,
        fill_measurement_rows(
            constants.sensors, state.motion, external, variances, present, lag, buffers.rows
        ),
    )
    arrays = SearchArrays(state.search_buffers, state.surface_cells, buffers.candidates, state.frames)
    problem = SingleContactProblem(
        searched_surface(constants), constants.touchable, state.motion, buffers.seeding.hypotheses,
        present[0], constants.prior,
    )  # fmt: skip
    single = SingleContactSearch(problem, arrays)
    model = SampleModel(
        seed_samples, measurement, constants.prior.friction_ratio, estimate_force_scale(external, present)
    )
    sought = Sought(Known(known_count, drift, not bandwidth < math.inf), max_contacts)
    count = search_contact_sets(single, model, sought, buffers)
    listed, row = 0, 0
    for k in range(count):
        t = explanations.order[k]
        if explanations.probability[t] < MIN_REPORTED_PROBABILITY:
            break
        for i in range(explanations.contacts[t]):
            found = CandidateRow(
                explanations.primitive[t, i], explanations.probability[t], explanations.torsion[t, i],
                explanations.point[t, i], explanations.normal[t, i], explanations.force[t, i],
                explanations.covariance[t, i],
            )  # fmt: skip
            write_row(constants, state, Grids(*skin), found, rows[row])
            row += 1
        listed += 1
    rank = 0
    if listed > 0:
        t = explanations.order[0]
        links = buffers.rank.link
        for i in range(explanations.contacts[t]):
            links[i] = constants.surfaces.link[explanations.primitive[t, i]]
        rank = rank_of(measurement, links, explanations.contacts[t], buffers.rank.matrix)
    return listed, rank
