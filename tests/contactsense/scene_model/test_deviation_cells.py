"""The deviations of tool and pedestal are those of the same body as a link of the arm."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, Scene, SceneError, robots
from contactsense.localization.surface.local_prior import DeviationCells
from contactsense.robots import Link, Robot
from contactsense.robots.primitives import Box, Vector
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.rotations import rotation_from_rpy, rpy_from_rotation
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.deviation_cells import deviation_cells
from contactsense.scene_model.scene_surfaces import scene_surfaces

FRAME = (rotation_from_rpy((0.3, -0.5, 1.1)), np.array([0.01, -0.02, 0.03]))
"""Rotation and translation of the body's frame in that of the link."""
BOXES = (
    Box(center=(0.0, 0.0, 0.1), rpy=(0.1, 0.2, 0.3), half=(0.05, 0.04, 0.06), rounding=0.005),
    Box(center=(0.12, 0.0, 0.1), rpy=(0.0, 0.0, 0.4), half=(0.08, 0.02, 0.02), rounding=0.004),
)
CELLS = (
    LocalDeviation(0, (0.05, 0.0, 0.1), 0.0008, 0.1),
    LocalDeviation(0, (0.0, 0.04, 0.12), 0.003, 0.4),
    LocalDeviation(1, (0.2, 0.0, 0.1), 0.002, 0.3),
)


def table(cells: tuple[LocalDeviation, ...]) -> str:
    """The lines of a table, not rounded."""
    return (
        "\n".join(
            " ".join(
                map(repr, (c.primitive, *(1e3 * x for x in c.point), 1e3 * c.offset, np.degrees(c.tilt)))
            )
            for c in cells
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )


def in_link(place: Vector) -> Vector:
    x, y, z = (FRAME[0] @ place + FRAME[1]).tolist()
    return x, y, z


def linked(number: int) -> Robot:
    """A UR5e whose link with that number has the boxes and their cells for its surface."""
    robot = robots.load("ur5e")
    boxes = tuple(
        box.model_copy(
            update={
                "center": in_link(box.center),
                "rpy": rpy_from_rotation(FRAME[0] @ rotation_from_rpy(box.rpy)),
            }
        )
        for box in BOXES
    )
    cells = tuple(cell._replace(point=in_link(cell.point)) for cell in CELLS)
    return with_link(robot, number, Link("", robot.links[number].inertia, boxes, (), cells))


def with_link(robot: Robot, number: int, link: Link) -> Robot:
    links = list(robot.links)
    links[number] = replace(link, name=links[number].name)
    return replace(robot, links=tuple(links))


def bare(number: int) -> Robot:
    """A UR5e whose link with that number has no surface."""
    robot = robots.load("ur5e")
    return with_link(robot, number, Link("", robot.links[number].inertia))


def as_tool() -> Scene:
    arm = replace(bare(6), flange_rotation=FRAME[0], flange_translation=FRAME[1])
    return Scene(robot=arm, tool=Tool(name="hand", primitives=BOXES, deviation=table(CELLS)))


def as_pedestal() -> Scene:
    """The boxes as two bodies, of which each has the table of its own primitive."""
    posts = [
        Body(
            name=f"post {k}",
            role="pedestal",
            rpy=rpy_from_rotation(FRAME[0]),
            translation=tuple(FRAME[1].tolist()),
            primitives=(BOXES[k],),
            deviation=table(tuple(cell._replace(primitive=0) for cell in CELLS if cell.primitive == k)),
        )
        for k in range(2)
    ]
    return Scene(robot=bare(0), bodies=(posts[0], Body(name="rail", primitives=(BOXES[1],)), posts[1]))


def cells_of(scene: Scene) -> DeviationCells:
    return deviation_cells(scene, scene_surfaces(scene))


def per_primitive(cells: DeviationCells, p: int) -> list[np.ndarray]:
    own = slice(cells.start[p], cells.start[p + 1])
    rows = (cells.point, cells.ratio, cells.tilt, cells.rotation, cells.translation, cells.mean_point)
    return [row[own] for row in rows]


def test_the_cells_of_a_tool_are_those_of_the_same_link() -> None:
    link, tool = cells_of(Scene(robot=linked(6))), cells_of(as_tool())
    assert len(link.start) == len(tool.start)
    np.testing.assert_array_equal(np.diff(tool.start)[-2:], [2, 1])
    for p in range(len(link.start) - 1):
        for of_link, of_tool in zip(per_primitive(link, p), per_primitive(tool, p), strict=True):
            np.testing.assert_allclose(of_tool, of_link, atol=1e-12)


def test_the_cells_of_a_pedestal_are_those_of_the_same_base_link() -> None:
    link, pedestal = cells_of(Scene(robot=linked(0))), cells_of(as_pedestal())
    np.testing.assert_array_equal(np.diff(pedestal.start)[:2], [2, 1])
    for p in range(len(link.start) - 1):
        for of_link, of_pedestal in zip(per_primitive(link, p), per_primitive(pedestal, p), strict=True):
            np.testing.assert_allclose(of_pedestal, of_link, atol=1e-12)


def test_a_pedestal_follows_the_base_links_own_cells() -> None:
    posts = tuple(body for body in as_pedestal().bodies if body.role == "pedestal")
    without, both = cells_of(Scene(robot="ur5e")), cells_of(Scene(robot="ur5e", bodies=posts))
    own = len(robots.load("ur5e").links[0].primitives)
    np.testing.assert_array_equal(both.start[: own + 1], without.start[: own + 1])
    np.testing.assert_array_equal(np.diff(both.start)[own : own + 2], [2, 1])
    np.testing.assert_array_equal(np.diff(both.start)[own + 2 :], np.diff(without.start)[own:])


def test_a_tool_that_cannot_be_touched_has_no_cells() -> None:
    arm = as_tool()
    left_out = Scene(robot=arm.robot, tool=arm.tool, touchable=("forearm",))
    assert len(cells_of(left_out).ratio) == len(robots.load("ur5e").links[3].deviation)


def test_one_stated_error_replaces_the_tables() -> None:
    stated = as_tool().model_copy(update={"surface_error": 0.001})
    assert not cells_of(stated).ratio.any()


def test_a_tool_with_steep_places_has_unmodelled_ones() -> None:
    assert build_constants(as_tool()).unmodelled.log_weight[7] > -np.inf


def test_contacts_on_a_tool_are_those_on_the_same_link() -> None:
    """Places, covariances and probabilities; the tool is a link of its own, but of the same body."""
    of_link, of_tool = Localizer(Scene(robot=linked(6))), Localizer(as_tool())
    rng = np.random.default_rng(4)
    for _ in range(20):
        q, point = rng.uniform(-2.0, 2.0, 6), rng.normal(0.0, 0.3, 3)
        force = 15.0 * rng.normal(size=3)
        wrench = np.concatenate((force, np.cross(point, force)))
        torque = rng.normal(0.0, 3.0, 6)
        a, b = (
            localizer.locate(q, base_wrench=wrench, joint_torque=torque, detect=False)
            for localizer in (of_link, of_tool)
        )
        assert len(a.contacts) == len(b.contacts)
        for one, other in zip(a.contacts, b.contacts, strict=True):
            assert other.link == ("hand" if one.link == "wrist_3" else one.link)
            assert other.probability == pytest.approx(one.probability, rel=1e-6, abs=1e-9)
            np.testing.assert_allclose(other.point_base, one.point_base, atol=1e-8)
            np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-5, atol=1e-12)


def test_a_table_without_primitives_is_refused() -> None:
    with pytest.raises(SceneError, match=r"tool\.deviation: expected primitives as well"):
        Scene(robot="ur5e", tool={"mass": 1.0, "deviation": "0 0 0 0 0.5 3"})


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("2 0 0 0 0.5 3", r"tool\.deviation: expected finite numbers: a primitive below 2.*'2 0 0 0 0\.5 3'"),
        ("0 0 0 0 -1 3", r"tool\.deviation: expected a positive distance"),
        ("0 0 0 0 0.5", r"tool\.deviation: expected finite numbers"),
    ],
)
def test_a_table_that_is_not_of_the_primitives_is_refused(line: str, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        Scene(robot="ur5e", tool={"primitives": [box.model_dump() for box in BOXES], "deviation": line})
