"""RTDE output fields from a recorded motion."""

from collections.abc import Mapping, Sequence

import numpy as np

from contactsense.service.mock.arm.cell import TORQUE_CONSTANTS
from contactsense.service.mock.interfaces.rtde_fields import Controller, Getter
from contactsense.service.mock.playback import Feed, Playback
from contactsense.service.wire.recipe import Number
from contactsense.service.wire.rtde_fields import OUTPUTS, WIDTHS


class PlaybackController(Controller):
    """A controller whose arm plays a recorded motion and ignores the commands of clients.

    Args:
        feed: The motion.
        playback: Determines which sample is due.
        version: Version of the controller's software: major, minor, bugfix, build.
        torque_constants: Joint torque per motor current for the field `actual_current`, shape (6,) [Nm/A].
        fields: Values of additional fields, or values that replace the usual ones: constant, shape (width,),
            or one row per sample, shape (N,) or (N, width).

    Raises:
        ValueError: The motion does not have 6 joints, or `fields` contains an unknown name or a wrong shape.
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
        """Set a field, such as an output register, to a constant value."""
        self._columns.pop(name, None)
        super().set_output(name, values)

    def moving_field(self, name: str) -> Getter | None:
        """Return the getter of a field of the recorded motion."""
        column = self._columns.get(name)
        if column is None:
            return None
        rows: np.ndarray = column

        def get(t: float) -> Sequence[Number]:
            # A field that is set while clients read it keeps that value.
            if name not in self._columns:
                return self._values[name]
            row: list[Number] = rows[self._playback.index(t)].tolist()
            return row

        return get
