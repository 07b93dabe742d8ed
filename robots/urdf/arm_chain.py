"""Which joints of a URDF are the arm's."""

from typing import Any

from contactsense.robots.urdf.urdf_document import MOVING, TURNING


def way_to(link: str, parent: dict[str, Any]) -> list[Any]:
    """Joints from the root to a link."""
    way: list[Any] = []
    while link in parent:
        joint = parent[link]
        if joint in way:
            break
        way.append(joint)
        link = joint.parent
    return way[::-1]


def longest_way(links: list[str], parent: dict[str, Any]) -> list[Any]:
    """Joints from the root to the end of the arm: the longest chain of revolute joints, without the fingers
    of a gripper.

    Fingers are chains that begin side by side at one link, and are shorter than the arm up to there.
    """

    def count(way: list[Any]) -> int:
        return sum(_own(joint) for joint in way)

    ways = {link: way_to(link, parent) for link in links}
    way = max(ways.values(), key=lambda way: (count(way), -len(way)))
    branches: dict[str, set[str]] = {}
    for other in ways.values():
        if any(joint.type in MOVING for joint in other):
            last = max(i for i, joint in enumerate(other) if joint.type in MOVING)
            for joint in other[: last + 1]:
                branches.setdefault(joint.parent, set()).add(joint.name)
    for i, joint in enumerate(way):
        if len(branches[joint.parent]) > 1 and 0 < count(way[i:]) < count(way[:i]):
            way = way[:i]
            break
    while way and not _own(way[-1]):
        way = way[:-1]
    return way


def _own(joint: Any) -> bool:
    """Whether a joint turns, by itself."""
    return joint.type in TURNING and joint.mimic is None
