"""Whether one link is touched in all stretches of a contact, or the touched link changes.

Between two stretches the touched link may change; the new one is drawn from the prior. This is a hidden
Markov model, whose forward recursion sums over all moments and links of all changes. Two contacts overlapping
in time show as changes of the link: from the first one to what explains both, and on to the one that remains.
No change and any change have equal prior probability, as have a fixed and a moving place
(`contactsense.service.analysis.smoothing.contact_smoothing`).
"""

import numpy as np
from scipy.special import logsumexp


def log_odds_of_one_link(prior: np.ndarray, ratio: np.ndarray) -> float:
    """Log odds that the same link is touched in all stretches; infinite for a single stretch.

    Args:
        prior: Probability of each link, shape (links,).
        ratio: Likelihood of each stretch for each link, up to a factor for each stretch, shape (S, links).
    """
    changes = len(ratio) - 1
    if changes == 0:
        return float("inf")
    chance = 1.0 - 0.5 ** (1.0 / changes)
    with np.errstate(divide="ignore"):
        log_prior, log_ratio = np.log(prior), np.log(ratio)
    stay, change = np.log1p(-chance), np.log(chance)
    # `same` without a change so far, `other` with one at least, by the link touched last.
    same, other = log_prior + log_ratio[0], np.full(len(prior), -np.inf)
    for of_links in log_ratio[1:]:
        drawn = change + logsumexp(np.concatenate((same, other))) + log_prior
        other = np.logaddexp(other + stay, drawn) + of_links
        same = same + stay + of_links
    return float(logsumexp(same) - logsumexp(other))
