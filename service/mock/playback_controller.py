"""RTDE output fields off a recorded motion."""

from collections.abc import Mapping, Sequence

import numpy as np

from contactsense.service.mock.cell import TORQUE_CONSTANTS
from contactsense.service.mock.controller import Controller, Getter
from contactsense.service.mock.playback import Feed, Playback
from contactsense.service.wire.recipe import Number
from contactsense.service.wire.rtde_fields import OUTPUTS, WIDTHS


class PlaybackController(Controller):
    """A controller whose arm repeats a recorded motion, whatever clients ask of it.

    Args:
        feed: The motion.
        playback: Which sample is due when.
        version: Major, minor and bugfix version and build of the controller's software.
        torque_constants: Newton metres per ampere, for the field `actual_current`, shape (6,).
        fields: Values of further fields, or others than usual: numbers that stay, shape (width,), or a row
            per sample, shape (N,) or (N, width).

    Raises:
        ValueError: The motion is not one of 6 joints, or `fields` holds an unknown name or a wrong shape.
    """

    def __init__(
        self,
        feed: Feed,
        playback: Playback,
        *,
        version: tuple[int, int, int, int] = (5, 23, 0, 0),
        torque_constants: Sequence[float] = TORQUE_CONSTANTS,
        fields: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        if feed.q.ndim != 2 or feed.q.shape[1] != 6:
            raise ValueError(f"expected a motion of 6 joints, got joint positions of shape {feed.q.shape}")
        super().__init__(version, float(feed.t[0]))
        self._playback = playback
        torque = np.asarray(feed.joint_torque, dtype=float)
        current = torque / np.asarray(torque_constants, dtype=float)
        qdd = np.gradient(np.asarray(feed.qd, dtype=float), 1.0 / feed.rate, axis=0)
        self._columns: dict[str, np.ndarray] = {
            "actual_q": feed.q,
            "target_q": feed.q,
            "actual_qd": feed.qd,
            "target_qd": feed.qd,
            "target_qdd": qdd,
            "actual_current": current,
            "joint_control_output": current,
            "actual_current_as_torque": torque,
        }
        for name, values in (fields or {}).items():
            self._override(name, np.asarray(values), len(feed.t))

    def _override(self, name: str, values: np.ndarray, n: int) -> None:
        if name not in OUTPUTS:
            raise ValueError(f"fields: expected names of RTDE outputs, got {name!r}")
        width = WIDTHS[OUTPUTS[name]]
        if values.size == width and values.ndim <= 1:
            self.set_output(name, values.reshape(width).tolist())
        elif values.shape in ((n, width), (n,)[: 1 if width == 1 else 0]):
            self._columns[name] = values.reshape(n, width)
        else:
            raise ValueError(
                f"fields: {name}: expected shape ({width},) or ({n}, {width}), got {values.shape}"
            )

    def set_output(self, name: str, values: Sequence[Number]) -> None:
        """Give a field a value that stays, such as an output register."""
        self._columns.pop(name, None)
        super().set_output(name, values)

    def moving_field(self, name: str) -> Getter | None:
        """How to get a field of the recorded motion."""
        column = self._columns.get(name)
        if column is None:
            return None
        rows: np.ndarray = column

        def get(t: float) -> Sequence[Number]:
            # A field that is set while clients read it stays so from then on.
            if name not in self._columns:
                return self._values[name]
            row: list[Number] = rows[self._playback.index(t)].tolist()
            return row

        return get
