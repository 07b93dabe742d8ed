"""The classical pipeline: the link from the evidence of the sensors (Eberman & Salisbury 1989), then the
paper's solver on that link. Compiled only where it is asked for."""

import numpy as np

from contactsense.localization.intrinsic_contact import centroid_covariance, contact_on_link
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel, kernel, nogil_kernel
from contactsense.robots.surface.signed_distance_grid import Grids, Skin
from contactsense.robots.vectors import add, rotate, vector
from contactsense.runtime.answer import store_first
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.candidate_rows import CandidateRow, write_row
from contactsense.runtime.explanation import (
    isolate_links,
    most_probable_link,
)
from contactsense.runtime.state import State
from contactsense.runtime.static_residuals import Measured, take_static_sample
from contactsense.scene_model.constants import Constants
from contactsense.solvers.wrench import Wrench, in_frame


@inlined_kernel
def write_intrinsic_contact(constants: Constants, state: State, skin: Grids, row: np.ndarray) -> int:
    """Contact of the fused wrench on the most probable link, after `isolate_links`.

    The method knows no probabilities: the link's is 1, and so is that of the contact.

    Args:
        constants, state: With link hypotheses; `link_probability` is filled.
        skin: As for `write_candidates`.
        row: Filled where there is a contact.

    Returns:
        Number of contacts: 0 if no push on that link balances the wrench.
    """
    state.link_probability[:] = 0.0
    link = most_probable_link(constants, state)
    if link < 0:
        return 0
    state.link_probability[link] = 1.0
    body = constants.sensors.depth[link]
    R, origin = state.motion.rotation[body], vector(state.motion.origin[body])
    wrench = state.hypotheses.wrench[link]
    force = vector(wrench)
    local = in_frame(Wrench(force, vector(wrench[3:])), R, origin)
    primitive, point, normal, torsion = contact_on_link(constants.surfaces, link, local, True)
    if primitive < 0:
        return 0
    candidates = state.candidates
    point, normal = add(origin, rotate(R, point)), rotate(R, normal)
    for i in range(3):
        candidates.point[0, i] = point[i]
        candidates.normal[0, i] = normal[i]
        candidates.force[0, i] = force[i]
    centroid_covariance(
        point,
        normal,
        force,
        state.hypotheses.covariance[link],
        constants.prior.surface_deviation,
        candidates.covariance[0],
    )
    found = CandidateRow(
        primitive, 1.0, torsion, candidates.point[0], candidates.normal[0], candidates.force[0],
        candidates.covariance[0],
    )  # fmt: skip
    write_row(constants, state, skin, found, row)
    return 1


@kernel
def localize_intrinsic(
    buffers: Buffers,
    skin: Skin,
) -> int:
    """The contact of a stream's newest residuals, after `contactsense.runtime.newest_sample.localize`.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`.
        skin: As for `contactsense.runtime.newest_sample.localize`.

    Returns:
        Number of contacts.
    """
    constants, state = buffer_views(buffers)
    rows = state.answer.rows
    count: int = write_intrinsic_contact(constants, state, Grids(*skin), rows[0])
    store_first(count, rows, state.hypotheses, constants.surfaces.start, state.answer)
    return count


@nogil_kernel
def batch_intrinsic(
    buffers: Buffers,
    skin: Skin,
    measured: Measured,
    external: bool,
    has_torque: bool,
    link_sensors: int,
    no_contact_energy: np.ndarray,
    link_probability: np.ndarray,
    best: np.ndarray,
) -> None:
    """The contacts of N measurements of an arm at rest; arguments as for
    `contactsense.runtime.kernels.batch`. The state after the last one remains."""
    constants, state = buffer_views(buffers)
    grids = Grids(*skin)
    q, torque, base_wrench, link_wrench = measured
    for i in range(q.shape[0]):
        take_static_sample(constants, state, (q[i], torque[i], base_wrench[i], link_wrench[i]), external)
        no_contact_energy[i] = isolate_links(constants, state, True, has_torque, link_sensors, 1.0)
        count = write_intrinsic_contact(constants, state, grids, best[i])
        if count == 0:
            best[i] = 0.0
            best[i, 0] = -1.0
        store_first(count, best[i : i + 1], state.hypotheses, constants.surfaces.start, state.answer)
        copy(state.link_probability, link_probability[i])
