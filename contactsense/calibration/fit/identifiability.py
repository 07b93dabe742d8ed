"""Identifiability: which parameters a motion excites, by the singular values of the scaled regressor.

With every parameter in units of its prior standard deviation, the eigenvalues of the information matrix are
the squared singular values of the weighted regressor. A direction with a small one is a combination of
parameters that the motion does not excite. Of the parameters in it, the least important is kept at the
scene's value; this repeats until every direction is excited.
"""

import numpy as np

from contactsense.calibration.parameters import GROUPS, Entry

_MIN_INFORMATION = 4.0
"""Smallest information about an excited direction, in units of the prior's: its standard deviation is halved.
"""
_MIN_PARTICIPATION = 0.1
"""A parameter with a smaller squared component in an unexcited direction does not take part in it."""


def excited_directions(
    information: np.ndarray, selected: tuple[Entry, ...], candidates: np.ndarray
) -> tuple[np.ndarray, float]:
    """Which of the candidate parameters can be estimated together.

    Args:
        information: Information matrix of the data, shape (k, k).
        selected: The k parameters. Links' inertial parameters always have a prior and are never dropped.
        candidates: Shape (k,), bool.

    Returns:
        Those that can be estimated, shape (k,), bool; and the condition number of their scaled regressor.
    """
    free = candidates.copy()
    nuisance = np.array([entry.group == "links" for entry in selected])
    size = np.array([entry.prior_std for entry in selected])
    while True:
        estimated = np.flatnonzero(free & ~nuisance)
        if not len(estimated):
            return free, 1.0
        values, vectors = np.linalg.eigh(
            _marginal(information, size, estimated, np.flatnonzero(free & nuisance))
        )
        unexcited = values < _MIN_INFORMATION
        if not unexcited.any():
            return free, float(np.sqrt(values[-1] / values[0]))
        participation = np.sum(vectors[:, unexcited] ** 2, axis=1)
        involved = (
            estimated[participation > min(_MIN_PARTICIPATION, participation.max())]
            if (participation > _MIN_PARTICIPATION).any()
            else estimated[[participation.argmax()]]
        )
        rank = [
            (GROUPS.index(selected[i].group), participation[np.flatnonzero(estimated == i)[0]], i)
            for i in involved
        ]
        free[max(rank)[2]] = False


def _marginal(
    information: np.ndarray, size: np.ndarray, estimated: np.ndarray, nuisance_indices: np.ndarray
) -> np.ndarray:
    """Scaled information about `estimated`, marginalized over the nuisance parameters with their prior."""
    scaled: np.ndarray = information * np.outer(size, size)
    direct: np.ndarray = scaled[np.ix_(estimated, estimated)]
    if not len(nuisance_indices):
        return direct
    cross = scaled[np.ix_(estimated, nuisance_indices)]
    nuisance_information = scaled[np.ix_(nuisance_indices, nuisance_indices)] + np.eye(len(nuisance_indices))
    lost: np.ndarray = cross @ np.linalg.solve(nuisance_information, cross.T)
    marginal: np.ndarray = direct - lost
    return marginal
