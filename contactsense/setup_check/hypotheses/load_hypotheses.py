"""Something mounted on a link that neither scene nor arm states, such as a valve block or a cable harness.

The prior of the links' inertia takes up a part of it, so that no residual need fall: its penalty does.
"""

from dataclasses import replace

from contactsense.scene import Scene
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.lines import inertia_line, loaded_links
from contactsense.setup_check.setup import Free, Setup

_FIRST = 1.0
"""Mass from which a fit starts, at the link's centre of mass [kg]."""


def link_loads(scene: Scene, setup: Setup) -> list[Hypothesis]:
    """A load on each link.

    Only what explains the readings is reported: a motion seldom determines the loads of all links, so that
    without a load nothing is said of them.
    """
    found = []
    for link in loaded_links(len(setup.loads)):
        loads = setup.loads.copy()
        loads[link] += _FIRST
        start = "", replace(setup, loads=loads)
        free = Free("load", link=link), Free("place", link=link)
        line = inertia_line(scene, link)
        found.append(Hypothesis(line, (start,), free, special=True, absorbed=True))
    return found
