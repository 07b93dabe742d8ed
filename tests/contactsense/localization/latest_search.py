"""The problem and the arrays of a localizer's latest measurement, as the searches for a contact take them."""

from contactsense import Localizer
from contactsense.localization.problem.searched_surface import SearchArrays, SearchedSurface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem


def latest_search(localizer: Localizer) -> tuple[SingleContactProblem, SearchArrays]:
    """What a search for one contact gets, if base wrench and joint torques were measured."""
    constants, state = localizer._buffers.constants, localizer._buffers.state
    surface = SearchedSurface(
        constants.surfaces, constants.samples, constants.surface_blocks, constants.subsamples,
        constants.deviations, constants.touchable, constants.left_out, constants.unmodelled,
        constants.sensors.depth,
    )  # fmt: skip
    problem = SingleContactProblem(
        surface, constants.touchable, state.motion, state.hypotheses, True, constants.prior
    )
    return problem, SearchArrays(state.search_buffers, state.surface_cells, state.candidates, state.frames)
