"""The picture of a contact in a real browser: nothing hides the contact at first."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from contactsense.benchmarks.browser import browser_page
from contactsense.service.drawing.arm_scene import packed, view_script
from contactsense.service.drawing.mesh import Mesh
from contactsense.service.drawing.palette import CONTACT, link_colour, rgb
from tests.browser import require_browser

pytestmark = pytest.mark.slow


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    made = trimesh.creation.box(bounds=np.array([low, high]))
    return Mesh(np.asarray(made.vertices), np.asarray(made.faces))


def pixels_of_the_region(screens: tuple[Mesh, ...], folder: Path) -> int:
    """Pixels in the colour of a contact on the side +x of a post, behind screens that are other links."""
    links = (box((-0.1, -0.1, -0.5), (0.1, 0.1, 0.5)), *screens)
    geometry = [{"color": link_colour(i), **packed(mesh)} for i, mesh in enumerate(links)]
    pose = [0.0, 0.0, 0.0, *np.eye(3).ravel()]
    view: dict[str, Any] = {
        "poses": [pose] * len(links),
        "up": [0.0, 0.0, 1.0],
        "point": [100.0, 0.0, 0.0],
        "normal": [1.0, 0.0, 0.0],
        "region": {"link": 0, **packed(box((0.1, -0.05, -0.05), (0.101, 0.05, 0.05)))},
        "color": CONTACT,
    }
    page_file = folder / "page.html"
    page_file.write_text(
        "<canvas style='width: 400px; height: 400px'></canvas>drawn"
        f"<script>{view_script()}; drawArm(document.querySelector('canvas'), {json.dumps(geometry)}, "
        f"{json.dumps(view)});</script>"
    )
    with browser_page(page_file.as_uri(), folder / "profile") as (page, _):
        page.wait_for("drawn")
        picture = page.screenshot()[..., :3].astype(int)
    red, green, blue = rgb(CONTACT)
    hue = np.array([red, green, blue]) / blue
    return int((np.abs(picture - hue * picture[..., 2:]).max(axis=-1) < 40).sum(where=picture[..., 2] > 90))


def test_the_contact_is_seen_past_what_is_in_front_of_it(tmp_path: Path) -> None:
    require_browser()
    free, left, both = (tmp_path / name for name in ("free", "left", "both"))
    for folder in (free, left, both):
        folder.mkdir()
    # Seen from 0.5 rad to either side, the contact is behind these.
    beside = box((0.3, 0.05, -0.5), (0.32, 0.4, 0.5))
    opposite = box((0.3, -0.4, -0.5), (0.32, -0.05, 0.5))
    seen = pixels_of_the_region((), free)
    assert seen > 100
    assert pixels_of_the_region((beside,), left) > 30
    assert pixels_of_the_region((beside, opposite), both) > 30
