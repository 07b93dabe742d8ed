"""Joint positions or torques in another order than the arm's, or one of them with the opposite sign."""

from dataclasses import replace
from itertools import combinations

from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.lines import ANGLE_ORDER, TORQUE_ORDER
from contactsense.setup_check.setup import Order, Setup, plain_order


def angle_orders(setup: Setup) -> list[Hypothesis]:
    """Other orders of the joint positions, and of the torques with them, as a driver may publish all."""
    if setup.angle_order != plain_order(len(setup.gain)):
        return []
    starts = [(text, replace(setup, angle_order=order)) for text, order in _orders(setup.angle_order)]
    if setup.torque_order == setup.angle_order:
        starts += [
            (f"{text}, of the torques, too", replace(setup, angle_order=order, torque_order=order))
            for text, order in _orders(setup.angle_order)
        ]
    return [Hypothesis(ANGLE_ORDER, tuple(starts))]


def torque_orders(setup: Setup) -> list[Hypothesis]:
    """Other orders of the joint torques."""
    if setup.torque_order != plain_order(len(setup.gain)):
        return []
    starts = [(text, replace(setup, torque_order=order)) for text, order in _orders(setup.torque_order)]
    return [Hypothesis(TORQUE_ORDER, tuple(starts))]


def _orders(order: Order) -> list[tuple[str, Order]]:
    """Two joints exchanged, all reversed, or one with the opposite sign."""
    found = [("the last joint comes first", order[::-1])]
    for a, b in combinations(range(len(order)), 2):
        changed = list(order)
        changed[a], changed[b] = order[b], order[a]
        found.append((f"joints {a + 1} and {b + 1} are exchanged", tuple(changed)))
    return [*found, *(reversed_joint(order, joint) for joint in range(len(order)))]


def reversed_joint(order: Order, joint: int) -> tuple[str, Order]:
    """The order with the opposite sign of one joint, by its index, and what that is in words."""
    signs = (*order[:joint], -order[joint], *order[joint + 1 :])
    return f"joint {joint + 1} has the opposite sign", signs
