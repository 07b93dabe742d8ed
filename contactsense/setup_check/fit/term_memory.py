"""Terms of the equations that many setups share."""

from collections.abc import Callable, Hashable

import numpy as np

_LIMIT = 100_000_000
"""Bytes that the terms may take."""


class TermMemory:
    """Keeps the terms that were used last."""

    def __init__(self) -> None:
        self._known: dict[Hashable, np.ndarray] = {}  # the least recently used are the first
        self._taken = 0

    def get(self, key: Hashable, found: Callable[[], np.ndarray]) -> np.ndarray:
        """The terms of that key; those that are not known are worked out by `found`."""
        terms = self._known.pop(key, None)
        if terms is None:
            terms = found()
            self._taken += terms.nbytes
            while self._known and self._taken > _LIMIT:
                self._taken -= self._known.pop(next(iter(self._known))).nbytes
        self._known[key] = terms
        return terms
