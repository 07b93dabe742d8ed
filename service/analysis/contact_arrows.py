"""Contacts of an analysis as arrows over time, for a 3D panel next to the recording's own messages."""

from collections.abc import Iterator

import numpy as np

from contactsense.service.analysis.analysis import Analysis
from contactsense.service.analysis.summary.contact_summary import ContactSummary
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.recordings import Recording
from contactsense.types import Contact

ARROWS_PER_SECOND = 25.0
"""Rate at which an arrow is redrawn while its contact is active [Hz]."""


def contact_arrows(analysis: Analysis, recording: Recording) -> Iterator[tuple[float, list[Contact]]]:
    """Times and the contacts at each, for `contactsense.service.recordings.export.export`.

    Place and direction of the force move with the touched link; the magnitude of the force is taken from the
    force curve. Each contact is followed by a time without contacts, which removes its arrow. Contacts
    without a definite place are omitted.

    Args:
        analysis: The contacts.
        recording: The recording that was analysed.
    """
    poses = Summarizer(analysis.scene)
    for summary in analysis.contacts:
        if not summary.link:
            continue
        samples = np.searchsorted(recording.rows, (summary.row, summary.row_end))
        times = recording.t[samples[0] : samples[1]]
        wanted = np.arange(summary.begin, summary.begin + summary.duration, 1.0 / ARROWS_PER_SECOND)
        for i in np.unique(np.searchsorted(times, wanted).clip(max=len(times) - 1)):
            q = recording.q[samples[0] + i]
            yield float(times[i]), [_at(summary, poses, float(times[i]), q)]
        yield summary.begin + summary.duration, []


def _at(summary: ContactSummary, poses: Summarizer, t: float, q: np.ndarray) -> Contact:
    """The contact at time t [s] and joint positions q, shape (n,) [rad]."""
    _, at_peak = poses.link_pose(summary.q, summary.link_index)
    origin, rotation = poses.link_pose(q, summary.link_index)
    turn = rotation @ at_peak.T
    known = np.isfinite(summary.curve.force)
    size = float(np.interp(t, summary.curve.t[known], summary.curve.force[known]))
    return Contact(
        link=summary.link,
        link_index=summary.link_index,
        primitive=-1,
        probability=summary.probability,
        point=summary.point,
        point_base=origin + rotation @ summary.point,
        normal_base=turn @ summary.normal_base,
        force_base=turn @ summary.force_base * (size / summary.peak_force),
        torsion=summary.torsion,
        covariance=turn @ summary.covariance @ turn.T,
        id=summary.contact,
    )
