"""Explanations by what a scene can state.

Two axes of a force/torque sensor exchanged, or one reversed, and a turn explain the same readings as the
opposite sign and another turn. No field states an order of the axes, and not every sensor lets it be changed,
so that sign and turn are reported.
"""

from dataclasses import replace

from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.lines import AXES_ORDER, Line, signal_line
from contactsense.setup_check.search.change import Change, groups, with_changes
from contactsense.setup_check.search.explanation import Explanation, needed
from contactsense.setup_check.setup import SensorSetup, Setup


def by_stated_fields(fitter: Fitter, stated: Setup, found: Explanation) -> Explanation:
    """The explanation, with sign and turn of a sensor in place of the order of its axes and a turn.

    Args:
        fitter: Of the recordings.
        stated: The setup of the scene.
        found: An explanation of the readings.
    """
    for field in stated.sensors:
        turn, order, sign = f"{field}.rpy", signal_line(field, AXES_ORDER), f"{field}.sign"
        sensor = found.fit.setup.sensors[field].without_mirror()
        if sensor is not None and {turn, order} <= set(found.lines) and sign not in found.lines:
            found = _turned(fitter, stated, found, field, sensor)
    return found


def _turned(
    fitter: Fitter, stated: Setup, found: Explanation, field: str, sensor: SensorSetup
) -> Explanation:
    turn, order, sign = f"{field}.rpy", signal_line(field, AXES_ORDER), f"{field}.sign"
    turned = stated.with_sensor(field, rotation=sensor.rotation)
    opposite = stated.with_sensor(field, sign=sensor.sign)

    def instead(change: Change) -> Change:
        if change.line == turn:
            return Change(turn, change.free, stated, turned, turned)
        return Change(sign, (), stated, opposite, opposite) if change.line == order else change

    def renamed(line: Line) -> Line:
        return sign if line == order else line

    changes = tuple(map(instead, found.changes))
    rest = tuple(change for change in changes if change.line != turn)
    unturned = fitter.fit(with_changes(rest, stated), groups(*(change.free for change in rest)))
    if fitter.cost(unturned) - fitter.cost(found.fit) < needed(turn):
        return found
    same = {"rotation": sensor.rotation, "order": sensor.order, "sign": sensor.sign}
    setup = found.fit.setup.with_sensor(field, **same)
    without = {renamed(line): fit for line, fit in found.without.items()} | {turn: unturned}
    rivals = {renamed(line): others for line, others in found.rivals.items()}
    return Explanation(changes, replace(found.fit, setup=setup), without, rivals)
