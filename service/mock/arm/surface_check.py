"""Checks that scripted contact points are on the surface of their link, and normals those of the outside."""

import numpy as np

from contactsense.robots import Robot
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import nearest
from contactsense.service.mock.arm.script import Script, ScriptError

OFF_SURFACE = 0.002
"""Largest accepted distance of a contact point from the link's primitives [m]."""
INWARD = -0.5
"""A normal points into the link if its cosine with that of the primitives is smaller. At edges and between
primitives the two may differ much."""


def check_contacts(script: Script, robot: Robot) -> None:
    """Check that every contact is on a link of the robot, and on its surface, and that no normal points into
    the link. Links without a surface can be touched anywhere.

    Args:
        script: The script.
        robot: The arm; a tool is its last link.

    Raises:
        ScriptError: A contact is not on the surface, or its normal points inward; the message names it and
            the nearest point of the surface, or the normal there.
    """
    surfaces = pack(robot.links)
    for index, contact in enumerate(script.contacts):
        if contact.link not in robot.link_names:
            raise ScriptError(
                f"contacts[{index}].link: expected one of {', '.join(robot.link_names)}, got {contact.link!r}"
            )
        link = robot.link_names.index(contact.link)
        x, y, z = (float(value) for value in contact.point)
        first, last = surfaces.start[link], surfaces.start[link + 1]
        gap, which, place, outward = nearest(surfaces, first, last, (x, y, z))
        if which >= 0 and abs(gap) > OFF_SURFACE:
            where = "outside of it" if gap > 0.0 else "inside"
            raise ScriptError(
                f"contacts[{index}].point: expected a point on the surface of {contact.link}, got one "
                f"{1e3 * abs(gap):.1f} mm {where}; the nearest is {(np.round(place, 4) + 0.0).tolist()}"
            )
        if which >= 0 and contact.normal is not None:
            normal = np.array(contact.normal) / np.linalg.norm(contact.normal)
            if float(normal @ outward) < INWARD:
                raise ScriptError(
                    f"contacts[{index}].normal: expected the outward normal of {contact.link}, here about "
                    f"{(np.round(outward, 2) + 0.0).tolist()}, got {list(contact.normal)}, which points "
                    "inward; a pull is a force_link or force_base"
                )
