"""The searched surface and the arrays of a localizer's latest measurement, as kernels take them."""

from contactsense import Localizer
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface


def latest_search(localizer: Localizer) -> tuple[SearchedSurface, SearchArrays]:
    """What a search for contacts gets."""
    constants, state = localizer._buffers.constants, localizer._buffers.state
    surface = SearchedSurface(
        constants.surfaces, constants.samples, constants.surface_blocks, constants.subsamples,
        constants.deviations, constants.touchable, constants.left_out, constants.unmodelled,
        constants.sensors.depth,
    )  # fmt: skip
    return surface, SearchArrays(state.search_buffers, state.surface_cells, state.candidates, state.frames)
