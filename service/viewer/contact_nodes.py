"""Contacts as nodes of a viser scene: arrow of the force, region of the place, label with the probability.

A browser redraws what it is sent, so only what has visibly changed is sent. A region takes about as long as
everything else in a frame together, so it follows the place less often than the arrow does.
"""

import math
import time
from dataclasses import dataclass, field

import numpy as np
import viser

from contactsense.scene import Scene
from contactsense.service.drawing.contact_shapes import arrow_ends, region_patch
from contactsense.service.drawing.palette import CONTACT, rgb
from contactsense.service.percent import in_percent
from contactsense.service.viewer.arm_nodes import BASE, link_node
from contactsense.types import Contact, Estimate

MOST = 8
"""Explanations that are drawn; further ones are improbable."""
ARROW = 0.009
"""Radius of the shaft of an arrow with probability 1 [m]."""
VISIBLE = 0.001
"""Movement that is drawn [m]."""
GROWTH = 0.1
"""Change of a region that is drawn: of its place and size, relative to its standard deviation, and of its
probability."""
INTERVAL = 0.2
"""Shortest time between two regions of one explanation [s]."""
LONGEST = 24
"""Characters of a link's name in the picture; a longer label would hide the arm on a phone. The panel has the
whole name."""


@dataclass(slots=True, eq=False)
class _Mark:
    """What is drawn of one explanation, and for which values."""

    number: int
    arrow: viser.ArrowsHandle
    label: viser.LabelHandle
    ends: np.ndarray = field(default_factory=lambda: np.full((2, 3), np.inf))
    region: viser.MeshHandle | None = None
    place: Contact | None = None
    """The contact whose region is drawn."""
    drawn: float = -math.inf
    """When the region was drawn [s]."""


class ContactNodes:
    """Draws the explanations of an estimate: each with an arrow, its 90 % region and a label."""

    def __init__(self, nodes: viser.SceneApi, scene: Scene) -> None:
        """Add the nodes, hidden."""
        self._nodes = nodes
        self._scene = scene
        self._marks = [
            _Mark(
                i,
                nodes.add_arrows(
                    f"{BASE}/contacts/{i}", np.zeros((1, 2, 3)), rgb(CONTACT), shaft_radius=ARROW,
                    head_radius=2.4 * ARROW, head_length=5.0 * ARROW, visible=False,
                ),
                nodes.add_label(f"{BASE}/contact labels/{i}", "", anchor="bottom-center", visible=False),
            )
            for i in range(MOST)
        ]  # fmt: skip

    def draw(self, estimate: Estimate | None, poses: np.ndarray) -> None:
        """Draw the explanations of an estimate.

        Args:
            estimate: None: there is none, and nothing is drawn.
            poses: Poses of the links in the base frame, shape (links, 4, 4).
        """
        now = time.monotonic()
        contacts = () if estimate is None else estimate.contacts[:MOST]
        for mark, contact in zip(self._marks, contacts, strict=False):
            pose = poses[contact.link_index]
            self._draw_arrow(mark, contact, pose)
            if mark.place is not None and mark.place.link_index != contact.link_index:
                self._remove_region(mark)
            if now - mark.drawn >= INTERVAL and (mark.place is None or not _looks_like(contact, mark.place)):
                self._draw_region(mark, contact, pose[:3, :3])
                mark.drawn = now
        for mark in self._marks[len(contacts) :]:
            if mark.arrow.visible:
                mark.arrow.visible = mark.label.visible = False
            self._remove_region(mark)

    def _draw_arrow(self, mark: _Mark, contact: Contact, pose: np.ndarray) -> None:
        # At the place on the link as it is drawn, which may be a moment ahead of the estimate.
        point = pose[:3, :3] @ contact.point + pose[:3, 3]
        ends = np.array(arrow_ends(point, contact.force_base))
        if not np.abs(ends - mark.ends).max() < VISIBLE:
            mark.ends = ends
            mark.arrow.points = ends[None]
            mark.label.position = ends[0]
        text = label(contact)
        if mark.label.text != text:
            mark.label.text = text
            mark.arrow.shaft_radius = ARROW * (0.4 + 0.6 * contact.probability)
        if not mark.arrow.visible:
            mark.arrow.visible = mark.label.visible = True

    def _draw_region(self, mark: _Mark, contact: Contact, rotation: np.ndarray) -> None:
        patch = region_patch(
            self._scene,
            contact.link_index,
            contact.point,
            rotation.T @ contact.normal_base,
            rotation.T @ contact.covariance @ rotation,
        )
        if len(patch.faces) == 0:
            self._remove_region(mark)
        else:
            # A node of the same name replaces the one before.
            mark.region = self._nodes.add_mesh_simple(
                f"{link_node(contact.link_index)}/region {mark.number}",
                patch.vertices,
                patch.faces,
                color=rgb(CONTACT),
                opacity=0.25 + 0.6 * contact.probability,
                side="double",
            )
        mark.place = contact

    def _remove_region(self, mark: _Mark) -> None:
        if mark.region is not None:
            mark.region.remove()
        mark.region = mark.place = None


def label(contact: Contact) -> str:
    """Link, force and probability of an explanation, such as `forearm 20 N, 98 %`."""
    name = contact.link if len(contact.link) <= LONGEST else f"{contact.link[: LONGEST - 1]}…"
    force = float(np.linalg.norm(contact.force_base))
    return f"{name} {force:.0f} N, {in_percent(contact.probability)}"


def _looks_like(contact: Contact, drawn: Contact) -> bool:
    """Whether the region of a contact is that which is drawn, as far as one can see."""
    if contact is drawn:
        return True
    # The trace does not change with the arm's posture.
    size, before = np.sqrt(np.trace(contact.covariance)), np.sqrt(np.trace(drawn.covariance))
    moved = np.abs(contact.point - drawn.point).max()
    return bool(
        contact.link_index == drawn.link_index
        and moved <= max(VISIBLE, GROWTH * before)
        and (size == before or abs(size - before) <= GROWTH * before)
        and abs(contact.probability - drawn.probability) < GROWTH
    )
