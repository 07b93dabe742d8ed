"""A contact estimated from all of its samples."""

from dataclasses import dataclass

import numpy as np

from contactsense.service.analysis.samples.contact_windows import ContactWindows
from contactsense.service.analysis.smoothing.place_search import Place


@dataclass(frozen=True, eq=False)
class SmoothedContact:
    """A contact estimated from all of its samples."""

    windows: ContactWindows
    """The measurements."""
    places: tuple[Place, ...]
    """Explanations, the most probable first."""
    probability: np.ndarray
    """Probability of each, shape (places,)."""
    link_probability: np.ndarray
    """Probability of each link, shape (links,)."""
    jumps: bool = False
    """Whether a place is constant over several windows and then another one, instead of moving."""

    @property
    def best(self) -> Place:
        """The most probable explanation."""
        return self.places[0]

    def at(self, t: np.ndarray, number: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places [m], outward normals and covariances [m^2] of one of the explanations, the best one by
        default, at K times [s], link frame, shapes (K, 3), (K, 3) and (K, 3, 3)."""
        chosen, times = self.places[number], self.windows.weighted_t
        nearest = np.searchsorted(0.5 * (times[1:] + times[:-1]), t)
        if self.jumps:
            return chosen.point[nearest], chosen.normal[nearest], chosen.covariance[nearest]
        point, normal = (
            np.column_stack([np.interp(t, times, column) for column in values.T])
            for values in (chosen.point, chosen.normal)
        )
        return point, normal / np.linalg.norm(normal, axis=1, keepdims=True), chosen.covariance[nearest]


def ranked(
    windows: ContactWindows, places: list[Place], links: int, *, jumps: bool = False
) -> SmoothedContact | None:
    """Explanations, weighted by their evidence; None if there are none. `links`: number of links; `jumps`:
    see `SmoothedContact`."""
    places = sorted(
        (place for place in places if np.isfinite(place.log_evidence)),
        key=lambda place: -place.log_evidence,
    )
    if not places:
        return None
    weight = np.exp([place.log_evidence - places[0].log_evidence for place in places])
    probability = weight / weight.sum()
    link_probability = np.zeros(links)
    np.add.at(link_probability, [place.link for place in places], probability)
    return SmoothedContact(windows, tuple(places), probability, link_probability, jumps)
