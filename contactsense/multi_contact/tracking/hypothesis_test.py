"""How hypotheses about several contacts are compared over time: intervals, and the margin of a decision."""

import math
from collections.abc import Sequence

from contactsense.multi_contact.tracking.multi_hypothesis_filter import Hypothesis

PRIOR_INTERVAL = 3.0
"""Interval between two updates of the prior, in time constants of the observers."""
SETTLING_TIME = 8.0
"""Time for which a further contact is searched before a change counts as a slide, in time constants."""
SEARCH_INTERVAL = 0.5
"""Interval between two tests of a single contact, or two searches, in time constants."""
SLIDE_DEVIATION, SHORT_SLIDE_DEVIATION = 0.04, 0.005
"""Standard deviations of a slide, and of one that has just begun [m]. With the first alone, a slow slide is
less probable than a further contact with a small force."""
_LOG_ODDS_MARGIN = 2.0


def is_more_probable(one: Sequence[Hypothesis], other: Sequence[Hypothesis]) -> bool:
    """Whether the best of some hypotheses is more probable than the best of others, by log odds of 2."""
    best = max((hypothesis.log_probability for hypothesis in other), default=-math.inf)
    return any(hypothesis.log_probability > best + _LOG_ODDS_MARGIN for hypothesis in one)
