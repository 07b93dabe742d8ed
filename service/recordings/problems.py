"""Problems found in a recording, by row."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "repeated",
    "gap",
    "clock_set_back",
    "not_finite",
    "bad_row",
    "cut_short",
    "missing_sensor",
    "not_in_scene",
    "schema",
    "held",
    "velocities",
    "other_torques",
    "other_arm",
]


class RecordingError(ValueError):
    """A recording that cannot be used: the message names the file, the column, the expected value and the
    actual one."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows of a recording that are missing, unusable or out of order; the other rows are used."""

    row_from: int
    """First affected row, counted from 0 in the file, without the header."""
    row_to: int
    """Row after the last affected one; 0 if the problem is one of the file as a whole."""
    kind: Kind
    message: str
    size: float = 0.0
    """How large it is, where it has a size: the time of a gap, or by which a clock was set back [s]; the
    share of the rows whose values are held; that of the movements which contradict their velocities."""

    @property
    def rows(self) -> str:
        """The affected rows as text: `5` or `5 to 9`."""
        last = self.row_to - 1
        return f"{self.row_from}" if last <= self.row_from else f"{self.row_from} to {last}"

    def __str__(self) -> str:
        if self.row_to == 0:  # of the file as a whole
            return self.message
        return f"{'row' if self.row_to - 1 <= self.row_from else 'rows'} {self.rows}: {self.message}"
