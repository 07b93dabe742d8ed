"""Which parameters a motion excites: singular values of the scaled regressor.

With every parameter counted in units of its plausible size, the eigenvalues of the information matrix are
the squared singular values of the weighted regressor. A direction with a small one is a combination of
parameters that the motion tells nothing about; of the parameters in such a combination the least important is
kept at the scene's value, and so on until every direction is seen.
"""

import numpy as np

from contactsense.calibration.parameters import GROUPS, Entry

_SEEN = 4.0
"""Least information about a direction, in units of the prior's: its standard deviation is halved."""
_SHARE = 0.1
"""A parameter with less than this share of an unseen direction has no part in it."""


def excited(
    information: np.ndarray, chosen: tuple[Entry, ...], wanted: np.ndarray
) -> tuple[np.ndarray, float]:
    """Which of the wanted parameters can be estimated.

    Args:
        information: What the data say, shape (k, k).
        chosen: The k parameters. Links' inertial parameters have a prior that always serves, and stay.
        wanted: Candidates, shape (k,), bool.

    Returns:
        Those that can be estimated together, shape (k,), bool; and the condition number of their scaled
        regressor.
    """
    free = wanted.copy()
    nuisance = np.array([entry.group == "links" for entry in chosen])
    size = np.array([entry.plausible for entry in chosen])
    while True:
        own = np.flatnonzero(free & ~nuisance)
        if not len(own):
            return free, 1.0
        values, vectors = np.linalg.eigh(_marginal(information, size, own, np.flatnonzero(free & nuisance)))
        unseen = values < _SEEN
        if not unseen.any():
            return free, float(np.sqrt(values[-1] / values[0]))
        share = np.sum(vectors[:, unseen] ** 2, axis=1)
        involved = own[share > min(_SHARE, share.max())] if (share > _SHARE).any() else own[[share.argmax()]]
        rank = [(GROUPS.index(chosen[i].group), share[np.flatnonzero(own == i)[0]], i) for i in involved]
        free[max(rank)[2]] = False


def _marginal(information: np.ndarray, size: np.ndarray, own: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Scaled information about `own`, the `rest` being known no better than their prior and the data tell."""
    scaled: np.ndarray = information * np.outer(size, size)
    inner: np.ndarray = scaled[np.ix_(own, own)]
    if not len(rest):
        return inner
    cross = scaled[np.ix_(own, rest)]
    known = scaled[np.ix_(rest, rest)] + np.eye(len(rest))
    learned: np.ndarray = cross @ np.linalg.solve(known, cross.T)
    marginal: np.ndarray = inner - learned
    return marginal
