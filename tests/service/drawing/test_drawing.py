"""Reports that draw what all pictures draw, axes with round numbers."""

import re
from base64 import b64decode

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.robots.primitives import Box
from contactsense.robots.surface.union import distances
from contactsense.robots.surroundings import Body
from contactsense.service.drawing.arm_scene import arm_geometry, arm_view, contact_view
from contactsense.service.drawing.link_geometry import geometry_of, link_meshes
from contactsense.service.drawing.palette import link_colour
from contactsense.service.drawing.timeline_svg import COLUMN, DIGIT, WIDTH, Curve, nice_step, panel


def unpacked(mesh: dict[str, str]) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.frombuffer(b64decode(mesh["vertices"]), dtype="<i2").reshape(-1, 3)
    return 1e-4 * vertices, np.frombuffer(b64decode(mesh["faces"]), dtype="<u2").reshape(-1, 3)


def test_a_report_has_the_meshes_that_all_pictures_have() -> None:
    scene = Scene(robot="ur5e")
    for i, (drawn, mesh) in enumerate(zip(arm_geometry(scene), link_meshes(scene), strict=True)):
        vertices, faces = unpacked(drawn)
        assert drawn["color"] == link_colour(i)
        np.testing.assert_allclose(vertices, mesh.vertices, atol=5.1e-5)
        np.testing.assert_array_equal(faces, mesh.faces)


def test_a_report_draws_pedestals_with_the_base_link() -> None:
    plate = Box(center=(0.0, 1.7, -0.05), half=(0.4, 2.0, 0.05), rounding=0.01)
    table = Box(center=(1.0, 0.0, -0.05), half=(0.4, 1.0, 0.05), rounding=0.01)
    bodies = (
        Body(name="plate", role="pedestal", primitives=(plate,)),
        Body(name="table", primitives=(table,)),
    )
    base, *others = arm_geometry(Scene(robot="ur5e", bodies=bodies))
    alone, *same = arm_geometry(Scene(robot="ur5e"))
    assert others == same
    (own, _), (vertices, faces) = unpacked(alone), unpacked(base)
    np.testing.assert_array_equal(vertices[: len(own)], own)
    added = vertices[len(own) :]
    assert faces.max() == len(vertices) - 1
    # No table, and the far end of the plate is cut off where the numbers of a report end.
    np.testing.assert_allclose(np.abs(added).max(axis=0), [0.4, 3.2, 0.1], atol=1e-4)
    assert (added[:, 1].min(), added[:, 1].max()) == pytest.approx((-0.3, 3.2), abs=1e-4)


def test_a_contact_is_drawn_where_it_is() -> None:
    scene = Scene(robot="ur5e")
    rotation = Rotation.from_euler("xyz", (0.3, 0.2, 0.1)).as_matrix()
    poses = [(np.array([0.1, 0.2, 0.3]), rotation)] * 7
    place = geometry_of(scene).triangles[3][100].mean(axis=0)
    _, _, normal = distances(geometry_of(scene).surfaces, place[None], 3)
    point, force = poses[3][0] + rotation @ place, rotation @ (-20.0 * normal[0])
    view = contact_view(scene, poses, 3, point, rotation @ normal[0], 1e-4 * np.eye(3), force)
    np.testing.assert_allclose(1e-3 * np.array(view["point"]), point, atol=1e-5)
    np.testing.assert_allclose(1e-3 * np.subtract(view["point"], view["arrow"]), 0.008 * force, atol=2e-5)
    vertices, faces = unpacked(view["region"])
    assert view["region"]["link"] == 3
    assert len(faces) > 20
    assert np.abs(distances(geometry_of(scene).surfaces, vertices, 3)[0]).max() < 0.001
    assert 0.015 < np.linalg.norm(vertices - place, axis=1).max() < 0.03


def test_a_contact_without_a_place_draws_the_arm_alone() -> None:
    scene, poses, nowhere = Scene(robot="ur5e"), [(np.zeros(3), np.eye(3))] * 7, np.full(3, np.nan)
    unknown = (nowhere, nowhere, np.full((3, 3), np.nan), np.ones(3))
    assert contact_view(scene, poses, -1, *unknown) == {}
    assert contact_view(scene, poses, 2, *unknown) == {}
    assert sorted(arm_view(poses, np.array([0.0, 0.0, 1.0]))) == ["poses", "up"]


@pytest.mark.parametrize(
    ("value", "step"), [(0.3, 0.5), (1.0, 1.0), (7.0, 10.0), (20.0, 20.0), (0.0011, 0.002)]
)
def test_axes_have_round_numbers(value: float, step: float) -> None:
    assert nice_step(value) == pytest.approx(step)


def test_a_panel_without_curves_is_a_picture_too() -> None:
    empty = Curve(np.empty(0), np.empty(0), "#000")
    assert panel([empty], (0.0, 0.0), "N", "a <title>").count("<svg") == 1
    assert "a &lt;title&gt;" in panel([empty], (0.0, 1.0), "N", "a <title>")


def test_what_is_not_known_is_a_gap() -> None:
    t = np.arange(7.0)
    curve = Curve(t, np.array([1.0, 2.0, np.nan, np.nan, 2.0, np.nan, 1.0]), "#000", filled=True)
    drawn = panel([curve], (0.0, 6.0), "N", "force")
    lines = [line.split() for line in re.findall(r'<polyline points="([^"]+)"', drawn)]
    assert [len(line) for line in lines] == [2, 2, 2]  # the last two are one value each
    right = [[float(place.split(",")[0]) for place in line] for line in lines]
    assert max(right[1]) - min(right[1]) == pytest.approx(1.0)
    assert drawn.count("<polygon") == 3


def test_a_curve_has_no_more_points_than_can_be_seen() -> None:
    """The thousands of contacts of a long recording took a page of tens of megabytes."""
    t = np.linspace(0.0, 1.0, 200_000)
    force = np.random.default_rng(1).normal(10.0, 1.0, len(t))
    force[77_777], force[123_456] = 39.0, 1.0
    drawn = panel([Curve(t, force, "#000")], (0.0, 1.0), "N", "force")
    (line,) = re.findall(r'<polyline points="([^"]+)"', drawn)
    places = np.array([place.split(",") for place in line.split()], dtype=float)
    assert len(places) <= 4 * WIDTH / COLUMN
    assert (np.diff(places[:, 0]) >= 0.0).all()
    whole = panel(
        [Curve(t[[0, 77_777, 123_456, -1]], force[[0, 77_777, 123_456, -1]], "#000")], (0.0, 1.0), "N", ""
    )
    (few,) = re.findall(r'<polyline points="([^"]+)"', whole)
    assert set(few.split()) <= set(line.split())


@pytest.mark.parametrize("curves", [[], [Curve(np.array([0.0, 1.0]), np.zeros(2), "#000")]])
def test_an_axis_without_any_force_has_usual_numbers(curves: list[Curve]) -> None:
    """As of a recording in which nothing touched the arm."""
    drawn = panel(curves, (0.0, 1.0), "N", "force")
    found = re.findall(r'text-anchor="end">([^<]+)</text>', drawn)
    assert found == ["0", "0.5", "1", "1.5", "time / s"]


@pytest.mark.parametrize(
    ("begin", "duration", "labels"),
    [
        (12.092, 0.0, ["12.0920", "12.0922", "12.0924", "12.0926", "12.0928"]),
        (0.0, 10.0, ["0", "2", "4", "6", "8", "10"]),
        (12.34, 0.8, ["12.4", "12.5", "12.6", "12.7", "12.8", "12.9", "13.0", "13.1"]),
        (200_000.0, 0.75, [f"200000.{k}" for k in range(8)]),
        (1_700_000_000.0, 30.0, [f"{1_700_000_000 + k}" for k in range(5, 26, 5)]),
        (1_700_000_000.05, 0.9, [f"1700000000.{k}" for k in (2, 4, 6, 8)]),
        (1_700_000_000.0004, 0.0, ["1700000000.0005", "1700000000.0010"]),
    ],
)
def test_times_of_any_clock_are_distinguishable(begin: float, duration: float, labels: list[str]) -> None:
    """They are those of the tables, do not overlap, and are within the picture."""
    curve = Curve(np.array([begin, begin + duration]), np.array([1.0, 1.5]), "#000")
    drawn = panel([curve], (begin, begin + duration), "N", "force")
    found = re.findall(r'<text x="([\d.]+)" y="[\d.]+" text-anchor="middle">([\d.]+)</text>', drawn)
    assert [label for _, label in found] == labels
    places = np.array([float(x) for x, _ in found])
    widths = DIGIT * np.array([len(label) for label in labels])
    assert np.diff(places).min() > widths.max()
    assert (places - 0.5 * widths).min() >= 0.0
    assert (places + 0.5 * widths).max() <= WIDTH
