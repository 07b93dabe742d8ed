"""Another scale and the opposite sign at once, of a signal, of its forces or moments, or of one joint.

A search for one line at a time may miss this pair: with the right sign alone, values of a far larger scale
contradict the scene even more, and with a positive scale the best size is zero.
"""

from dataclasses import replace

import numpy as np

from contactsense.setup_check.hypotheses.hypothesis import Hypothesis, SecondLine
from contactsense.setup_check.hypotheses.order_hypotheses import reversed_joint
from contactsense.setup_check.hypotheses.scaled_setups import (
    forces_in_units,
    moments_in_units,
    torques_in_units,
    wrench_times_units,
)
from contactsense.setup_check.lines import (
    AXES_ORDER,
    SCALE,
    TORQUE_ORDER,
    TORQUE_SIGN,
    TORQUE_SIGNAL,
    Line,
    signal_line,
)
from contactsense.setup_check.setup import BASE, SCALED, Free, Setup, plain_order


def reversed_torques(line: Line, setup: Setup, other: np.ndarray, moving: np.ndarray) -> list[Hypothesis]:
    """The joint torques with the opposite sign and another scale, or the other signal; or those of one joint.

    Args:
        line: Of the scale.
        setup: What is changed.
        other: Joint torques as read per torque, if they are the other signal, shape (n,).
        moving: Which joints move, shape (n,), as in `scale_hypotheses.torque_scales`.
    """
    turned = replace(setup, gain=-setup.gain)
    signal = "", replace(turned, gain=np.sign(turned.gain) * other)
    second = SecondLine(TORQUE_SIGN, "", turned)
    found = [
        Hypothesis(line, torques_in_units(turned), (Free("gain"),), special=True, second_line=second),
        Hypothesis(TORQUE_SIGNAL, (signal,), special=True, second_line=second),
    ]
    joints = np.flatnonzero(moving & (setup.gain != 0.0)).tolist()
    if len(joints) > 1 and BASE in setup.sensors:
        each = tuple(Free("gain", joint=joint) for joint in joints)
        found.append(Hypothesis(line, (("", turned),), each, special=True, second_line=second))
    plain = plain_order(len(setup.gain))
    if setup.torque_order == plain:
        for joint in joints:
            text, order = reversed_joint(plain, joint)
            one = replace(setup, torque_order=order)
            second, free = SecondLine(TORQUE_ORDER, text, one), (Free("gain", joint=joint),)
            found.append(Hypothesis(line, (("", one),), free, special=True, joint=joint, second_line=second))
    return found


def reversed_wrench(field: str, setup: Setup) -> list[Hypothesis]:
    """A force/torque sensor with the opposite sign and another scale, or its forces or moments alone."""
    sensor, line = setup.sensors[field], signal_line(field, SCALE)
    turned = setup.with_sensor(field, sign=-sensor.sign)
    same = wrench_times_units(turned, field)
    two = (*same, *moments_in_units(turned, field)[1:])
    free = Free("force", field), Free("moment", field)
    sign = SecondLine(f"{field}.sign", "", turned)
    of_forces, of_moments = (
        SecondLine(
            signal_line(field, AXES_ORDER),
            f"of the {kind}s all axes point the other way",
            setup.with_sensor(field, order=sensor.order * (1.0 - 2.0 * SCALED[kind])),
        )
        for kind in ("force", "moment")
    )
    pushes, twists = forces_in_units(of_forces.setup, field), moments_in_units(of_moments.setup, field)
    return [
        Hypothesis(line, same, (Free("wrench", field),), special=True, second_line=sign),
        Hypothesis(line, two, free, special=True, second_line=sign),
        Hypothesis(line, pushes, free[:1], special=True, second_line=of_forces),
        Hypothesis(line, twists, free[1:], special=True, second_line=of_moments),
    ]
