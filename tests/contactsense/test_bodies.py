"""Bodies of the cell: a pedestal on the sensor is touched, a cover is not, an obstacle is named."""

from typing import Any

import numpy as np
import pytest

from contactsense import Localizer, Scene, SceneError
from contactsense.localization.surface.surface_samples import cover_distances
from contactsense.readings import forward_model
from contactsense.robots.link_poses import link_poses
from contactsense.robots.primitives import Box, Cylinder, Sphere
from contactsense.robots.surroundings import Body
from contactsense.scene_model.constants import build_constants
from contactsense.types import Estimate
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.3, -0.6, 1.2, -1.9, -1.4, 0.5])
COLUMN = Cylinder(a=(0, 0, -0.4), b=(0, 0, 0), radius_a=0.12, radius_b=0.12, rounding=0.01)
SLAB = Box(center=(0, 0, -0.05), half=(0.6, 0.6, 0.05), rounding=0.01)


def _located(
    localizer: Localizer, link: str, point: np.ndarray, force: np.ndarray, q: np.ndarray = Q
) -> Estimate:
    """The answer to the readings that a push causes."""
    found = forward_model(localizer.scene, q, link, point, force, external=True)
    given: dict[str, Any] = {"base_wrench": found.base_wrench}
    if localizer.scene.joint_torque is not None:
        given["joint_torque"] = found.joint_torque
    return localizer.locate(q, **given)


def test_a_push_on_a_pedestal_is_found_on_it() -> None:
    pedestal = Body(name="column", role="pedestal", translation=(0.01, 0.0, 0.0), primitives=(COLUMN,))
    localizer = Localizer(Scene(robot=ARM, bodies=(pedestal,), touchable=("forearm",)))
    for angle, height in ((0.2, -0.3), (2.0, -0.1), (4.5, -0.2)):
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        point = np.array([0.01, 0.0, height]) + 0.12 * radial
        estimate = _located(localizer, "base", point, -30.0 * radial)
        contact = estimate.contacts[0]
        assert (estimate.status, contact.link, contact.body) == ("contact", "base", "column")
        assert np.linalg.norm(contact.point_base - point) < 0.005


def test_a_base_link_in_a_pedestal_is_not_the_pedestal() -> None:
    pedestal = Body(name="column", role="pedestal", primitives=(COLUMN,))
    localizer = Localizer(Scene(robot=ARM, bodies=(pedestal,)))
    estimate = _located(localizer, "base", np.array([0.0, 0.075, 0.05]), np.array([0.0, -30.0, 0.0]))
    assert (estimate.contacts[0].link, estimate.contacts[0].body) == ("base", "")
    assert estimate.contacts[0].primitive == 0


def test_what_stands_at_the_base_covers_it_in_all_postures() -> None:
    collar = Body(name="collar", role="cover", translation=(0.0, 0.0, 0.05), primitives=(COLUMN,))
    bare, covered = (build_constants(Scene(robot=ARM, bodies=bodies)) for bodies in ((), (collar,)))
    lower = covered.samples.point[: covered.samples.start[1]]
    assert lower[:, 2].min() > 0.05 - 0.004
    assert bare.samples.point[: bare.samples.start[1], 2].min() < 0.02
    assert covered.prior.area < bare.prior.area
    assert cover_distances(bare.surfaces, lower).min() == np.inf


def test_a_base_that_is_covered_and_all_that_can_be_touched_is_refused() -> None:
    ball = Sphere(center=(0.0, 0.0, 0.05), radius=0.5)
    hood = Body(name="hood", role="cover", primitives=(ball,))
    with pytest.raises(SceneError, match=r"^bodies: .*: bodies cover all of base, so that no place can be"):
        build_constants(Scene(robot=ARM, touchable=("base",), bodies=(hood,)))


def test_a_place_behind_a_wall_is_not_blamed() -> None:
    """The folded forearm lies beside the upper arm. A push through both, along the elbow's axis, is one on
    either of them for the base sensor alone, until something stands in the gap between them."""
    folded = np.array([0.3, -1.0, np.pi - 0.1, 0.4, 1.2, 0.0])
    axis = link_poses(ARM, folded)[3, :3, 2]
    push = ("forearm", np.array([-0.2, 0.0, -0.033]), 20.0 * axis, folded)
    scene = Scene(robot=ARM, joint_torque=None)
    before = _located(Localizer(scene), *push)
    other = next(contact for contact in before.contacts if contact.link == "upper_arm")
    assert other.probability > 0.2
    middle = other.point_base + 0.02 * other.normal_base
    wall = Body(
        name="wall",
        role="cover",
        primitives=(Sphere(center=tuple(middle.tolist()), radius=0.02),),
    )
    after = _located(Localizer(scene.model_copy(update={"bodies": (wall,)})), *push)
    assert after.link_probability[2] < 0.01
    assert (after.status, after.contacts[0].link) == ("contact", "forearm")


def _on_the_table(lower: float = 0.0) -> tuple[Localizer, np.ndarray]:
    """A cell whose forearm lies on a table, or is `lower` [m] above it, and the lowest point of its tube,
    link frame."""
    pose = link_poses(ARM, Q)[3]
    ends = np.array([[-0.05, 0.0, 0.007], [-0.34, 0.0, 0.007]]) @ pose[:3, :3].T + pose[:3, 3]
    lowest = ends[np.argmin(ends[:, 2])] - np.array([0.0, 0.0, 0.04])
    table = Body(name="table", translation=tuple(lowest - [0.0, 0.0, lower]), primitives=(SLAB,))
    return Localizer(Scene(robot=ARM, bodies=(table,))), pose[:3, :3].T @ (lowest - pose[:3, 3])


def test_an_arm_that_hits_a_table_names_it() -> None:
    localizer, point = _on_the_table()
    up = np.array([0.0, 0.0, 40.0])
    contact = _located(localizer, "forearm", point, up).contacts[0]
    assert (contact.link, contact.body) == ("forearm", "table")


def test_a_table_out_of_reach_is_not_named() -> None:
    localizer, point = _on_the_table(lower=0.03)
    assert _located(localizer, "forearm", point, np.array([0.0, 0.0, 40.0])).contacts[0].body == ""


def test_a_push_from_elsewhere_is_not_the_table() -> None:
    localizer, point = _on_the_table()
    rotation = link_poses(ARM, Q)[3, :3, :3]
    outward = point - np.array([point[0], 0.0, 0.007])
    across = np.cross(rotation.T @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    beside = np.array([point[0], 0.0, 0.007]) + 0.04 * across / np.linalg.norm(across)
    above = np.array([point[0], 0.0, 0.007]) - outward
    for place in (beside, above):
        inward = np.array([place[0], 0.0, 0.007]) - place
        force = 40.0 * rotation @ inward / np.linalg.norm(inward)
        contact = _located(localizer, "forearm", place, force).contacts[0]
        assert (contact.link, contact.body) == ("forearm", "")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"bodies": [{"name": "table", "primitives": []}]},
            r"^bodies\[0\]\.primitives: .*a length of at least 1, got 0",
        ),
        (
            {
                "bodies": [
                    {"name": "base", "primitives": [{"kind": "sphere", "center": [0, 0, 0], "radius": 1}]}
                ]
            },
            r"^bodies\[0\]\.name: expected a name that no link and no other body has, got 'base'$",
        ),
        (
            {"base_wrench": None, "bodies": [Body(name="post", role="pedestal", primitives=(COLUMN,))]},
            r"^bodies\[0\]\.role: pedestal: expected a base_wrench below it, got none",
        ),
        (
            {"bodies": [Body(name="post", rpy=(0.0, 0.0, 90.0), primitives=(COLUMN,))]},
            r"^bodies\[0\]\.rpy: expected roll, pitch, yaw in rad",
        ),
        (
            {"bodies": [{"name": "post", "role": "fence", "primitives": [COLUMN]}]},
            r"^bodies\[0\]\.role: .*'fence'$",
        ),
    ],
)
def test_bodies_that_cannot_be_are_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scene(robot=ARM, **fields)
