"""Which joint of a JointState message is which joint of the arm.

The order of a message is the publisher's: that of Universal Robots' ROS 2 driver is not that of the arm.
"""

from collections.abc import Sequence


def joint_order(names: Sequence[str], arm: Sequence[str], wanted: Sequence[str] | None) -> list[int] | None:
    """Places of the arm's joints in a message; None: it does not have them.

    Args:
        names: Joint names of the message.
        arm: Joint names of the arm. Those of the message may have a prefix, such as `left_`.
        wanted: Names in the message, in the order of the arm; None: those of the arm, or the order of the
            message if it has as many joints as the arm and none of its names.
    """
    if wanted is not None:
        return _found([[i for i, name in enumerate(names) if name == joint] for joint in wanted])
    exact = [[i for i, name in enumerate(names) if name == joint] for joint in arm]
    prefixed = [[i for i, name in enumerate(names) if name.endswith(joint)] for joint in arm]
    if any(prefixed):
        return _found(exact) or _found(prefixed)
    return list(range(len(arm))) if len(names) == len(arm) else None


def _found(places: list[list[int]]) -> list[int] | None:
    return [place[0] for place in places] if all(len(place) == 1 for place in places) else None
