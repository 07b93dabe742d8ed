"""Whether a contact that begins is a new one, or the last one again.

After a hard knock the arm rings, and the residuals swing to the other side; a weak touch at the threshold is
lost and found again. Each is one contact. Until the observers have settled, their residuals still contain the
contact that has ended, so an onset is no evidence of another one. Only the links can tell: with L the
likelihood of the new residuals, P(l) the links' probabilities in the last contact and p(l) those before any
measurement, the Bayes factor of "the same link as before" against "any link" is

    sum P(l) L(l) / sum p(l) L(l).

With even prior odds, as in `contactsense.service.analysis.smoothing.link_changes`, the contact is the same
where it is at least 1. What no link explains is as likely either way.
"""

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.sensors.stream_state import SETTLING_PERIODS
from contactsense.tracking.contact_track import NONE, ContactTrack, end_contact


@kernel
def release_contact(track: ContactTrack, dt: float) -> None:
    """In a sample without contact: end the contact, if there is one, so that it may resume.

    Args:
        track: Changed in place.
        dt: Time since the last sample [s].
    """
    status = track.status[0]
    since = status.time_since_end + dt if status.phase == NONE else 0.0
    end_contact(track)
    status.time_since_end = since


@kernel
def number_contact(
    track: ContactTrack, link_prior: np.ndarray, link_probability: np.ndarray, bandwidth: float
) -> None:
    """Number the contact that begins: the last number if it is the last contact again, else the next one.

    Args:
        track: Changed in place.
        link_prior: Probability of each link before any measurement, shape (links,).
        link_probability: The same after the first sample of the contact, shape (links,).
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    status = track.status[0]
    if status.time_since_end <= SETTLING_PERIODS / bandwidth and _may_be_same_link(
        track.link_weight, link_prior, link_probability
    ):
        return
    status.count += 1
    status.number = status.count
    track.link_weight[:] = 0.0


@kernel
def add_to_links(track: ContactTrack, energy: float, link_probability: np.ndarray) -> None:
    """Add a sample of the contact to the mean of its links' probabilities.

    Args:
        track: Changed in place.
        energy: Of the no-contact hypothesis: the weight of the sample.
        link_probability: Probability of each link in this sample, shape (links,).
    """
    for link in range(link_probability.shape[0]):
        track.link_weight[link] += energy * link_probability[link]


@kernel
def _may_be_same_link(weight: np.ndarray, prior: np.ndarray, probability: np.ndarray) -> bool:
    """Whether the same link as before is at least as likely as any link; see the module.

    Args:
        weight: Proportional to the probability of each link in the last contact; zeros: nothing is known.
        prior, probability: As for `number_contact`; the likelihood is proportional to their ratio.
    """
    total = 0.0
    for link in range(weight.shape[0]):
        total += weight[link]
    if not total > 0.0:
        return True
    same, any_link = 0.0, 0.0
    for link in range(weight.shape[0]):
        if prior[link] > 0.0:
            same += weight[link] / total * probability[link] / prior[link]
            any_link += probability[link]
    return same >= any_link
