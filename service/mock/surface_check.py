"""Checks that scripted contact points are on the surface of their link."""

import numpy as np

from contactsense.robots import Robot
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import nearest
from contactsense.service.mock.script import Script, ScriptError

OFF_SURFACE = 0.002
"""Largest accepted distance of a contact point from the link's primitives [m]."""


def check_contacts(script: Script, robot: Robot) -> None:
    """Check that every contact is on a link of the robot, and on its surface. Links without a surface can be
    touched anywhere.

    Args:
        script: The script.
        robot: The arm; a tool is its last link.

    Raises:
        ScriptError: A contact is not on the surface; the message names it and the nearest point of the
            surface.
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
        gap, which, place, _ = nearest(surfaces, first, last, (x, y, z))
        if which >= 0 and abs(gap) > OFF_SURFACE:
            where = "outside of it" if gap > 0.0 else "inside"
            raise ScriptError(
                f"contacts[{index}].point: expected a point on the surface of {contact.link}, got one "
                f"{1e3 * abs(gap):.1f} mm {where}; the nearest is {np.round(place, 4).tolist()}"
            )
