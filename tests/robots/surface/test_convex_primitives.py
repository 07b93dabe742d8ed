"""Projection, curvature and support of primitives against brute force and finite differences."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from contactsense.robots.files.file_model import FieldError
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Sphere
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface import convex_primitives as surface

SHAPES = {
    "sphere": Sphere(center=(0.1, 0.0, -0.2), radius=0.05),
    "capsule": Capsule(a=(0.0, 0.0, 0.0), b=(0.1, 0.2, -0.1), radius=0.04),
    "cylinder": Cylinder(a=(0.0, 0.0, -0.1), b=(0.0, 0.0, 0.1), radius_a=0.06, radius_b=0.06, rounding=0.01),
    "cone": Cylinder(a=(0.3, 0.0, 0.0), b=(0.0, 0.0, 0.1), radius_a=0.05, radius_b=0.08, rounding=0.005),
    "puck": Cylinder(a=(0.0, 0.0, 0.0), b=(0.0, 0.02, 0.0), radius_a=0.05, radius_b=0.05, rounding=0.01),
    "ellipsoid": Ellipsoid(center=(0.0, 0.1, 0.0), rpy=(0.3, -0.4, 1.0), radii=(0.03, 0.05, 0.09)),
    "spheroid": Ellipsoid(center=(0.0, 0.0, 0.0), radii=(0.05, 0.05, 0.02)),
    "box": Box(center=(0.0, 0.0, 0.1), rpy=(0.1, 0.2, 0.3), half=(0.05, 0.03, 0.02), rounding=0.005),
    "slab": Box(center=(0.0, 0.0, 0.0), half=(0.05, 0.03, 0.01), rounding=0.01),
}
NAMES = sorted(SHAPES)
coordinate = st.floats(-0.4, 0.4) | st.sampled_from([0.0, 0.05, -0.1, 1e-12])


@cache
def kind_and_size(name: str) -> tuple[int, np.ndarray]:
    surfaces = surface.pack([link(name)])
    return int(surfaces.kind[0]), surfaces.size[0]


def link(*names: str) -> Link:
    nothing = Inertia(mass=0.0, com=np.zeros(3), tensor=np.zeros((3, 3)))
    return Link(name="link", inertia=nothing, primitives=tuple(SHAPES[name] for name in names))


def core_and_ball(kind: int, size: np.ndarray) -> tuple[np.ndarray, float]:
    """Dense points of the core's boundary, and the ball's radius; for an ellipsoid its surface and 0."""
    if kind == surface.ELLIPSOID:
        u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 721), np.linspace(0, np.pi, 361))
        sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
        return sphere * size[:3], 0.0
    t = np.linspace(-1.0, 1.0, 121)
    if kind == surface.BOX:
        a, b = np.meshgrid(t, t)
        faces = []
        for axis in range(3):
            for sign in (-1.0, 1.0):
                points = np.empty((a.size, 3))
                points[:, axis] = sign
                points[:, (axis + 1) % 3] = a.ravel()
                points[:, (axis + 2) % 3] = b.ravel()
                faces.append(points * size[:3])
        return np.concatenate(faces), float(size[3])
    h, R0, R1, r = size[:4]
    s = (t + 1.0) / 2.0
    profile = np.concatenate(
        [
            np.stack([np.full_like(s, -h), R0 * s], axis=1),
            np.stack([-h + 2 * h * s, R0 + (R1 - R0) * s], axis=1),
            np.stack([np.full_like(s, h), R1 * s], axis=1),
        ]
    )
    angle = np.linspace(0, 2 * np.pi, 241)
    x = profile[:, 1:] * np.cos(angle)
    y = profile[:, 1:] * np.sin(angle)
    z = np.broadcast_to(profile[:, :1], x.shape)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), float(r)


@pytest.mark.parametrize("name", NAMES)
def test_distance_agrees_with_brute_force(name: str) -> None:
    kind, size = kind_and_size(name)
    core, ball = core_and_ball(kind, size)
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.2, 0.2, size=(200, 3))
    for point, nearest in zip(points, cKDTree(core).query(points)[0], strict=True):
        distance = surface.project(kind, size, *point)[0]
        inside = distance < 0.0 if kind == surface.ELLIPSOID else distance < -ball
        expected = (-nearest if inside else nearest) - ball
        # The samples of a core are at most 1.7 mm apart: near it that much, far from it far less.
        assert distance == pytest.approx(expected, abs=min(1.2e-3, 1e-6 * (30.0 + 1.0 / nearest)))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=150)
@given(x=coordinate, y=coordinate, z=coordinate)
def test_projection_is_consistent(name: str, x: float, y: float, z: float) -> None:
    kind, size = kind_and_size(name)
    distance, *rest = surface.project(kind, size, x, y, z)
    point, normal = np.array(rest[:3]), np.array(rest[3:])
    assert np.all(np.isfinite(rest))
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    # The query lies on the normal through the nearest point, at the distance.
    np.testing.assert_allclose(point + distance * normal, [x, y, z], atol=1e-9)
    # The nearest point is on the surface, and its normal is that normal.
    again = surface.project(kind, size, *point)
    assert again[0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(surface.project(kind, size, *(point + 0.01 * normal))[4:], normal, atol=1e-7)
    # A supporting plane: nothing of the body lies beyond it (the bodies are convex).
    farthest = np.array(surface.support(kind, size, *normal))
    assert farthest @ normal == pytest.approx(point @ normal, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=150)
@given(x=coordinate, y=coordinate, z=coordinate, reach=st.floats(-0.05, 0.3))
def test_nothing_within_reach_is_out_of_it(name: str, x: float, y: float, z: float, reach: float) -> None:
    kind, size = kind_and_size(name)
    if surface.out_of_reach(kind, size, x, y, z, reach):
        assert surface.project(kind, size, x, y, z)[0] >= reach - 1e-12


@pytest.mark.parametrize("name", ["sphere", "capsule", "cylinder", "cone", "puck"])
def test_what_is_far_beside_or_beyond_a_body_of_revolution_is_out_of_reach(name: str) -> None:
    kind, size = kind_and_size(name)
    assert kind == surface.REVOLVED
    across, along = max(size[1], size[2]) + size[3], size[0] + size[3]
    for reach in (0.0, 0.1):
        assert surface.out_of_reach(kind, size, across + reach + 1e-6, 0.0, 0.0, reach)
        assert surface.out_of_reach(kind, size, 0.0, 0.0, -(along + reach + 1e-6), reach)


@pytest.mark.parametrize("name", NAMES)
def test_signs(name: str) -> None:
    kind, size = kind_and_size(name)
    assert surface.project(kind, size, 0.0, 0.0, 0.0)[0] < 0.0
    assert surface.project(kind, size, 0.3, 0.3, 0.3)[0] > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_curvature_is_the_derivative_of_the_normal(name: str) -> None:
    kind, size = kind_and_size(name)
    rng = np.random.default_rng(2)
    checked = 0
    for direction in rng.normal(size=(300, 3)):
        start = 0.2 * direction / np.linalg.norm(direction)
        found = np.array(surface.project(kind, size, *start)[1:])
        point, normal = found[:3], found[3:]
        w = surface.curvature(kind, size, *point, *normal)
        W = np.array([[w[0], w[1], w[2]], [w[1], w[3], w[4]], [w[2], w[4], w[5]]])
        np.testing.assert_allclose(W @ normal, 0.0, atol=1e-6)
        assert np.linalg.eigvalsh(W).min() > -1e-6
        tangent = np.cross(normal, rng.normal(size=3))
        tangent /= np.linalg.norm(tangent)
        step = 1e-6
        ahead = np.array(surface.project(kind, size, *(point + step * tangent))[4:])
        behind = np.array(surface.project(kind, size, *(point - step * tangent))[4:])
        if np.linalg.norm((ahead - normal) - (normal - behind)) > 1e-7:
            continue  # a seam between face and rim, where the curvature jumps
        np.testing.assert_allclose(
            W @ tangent, (ahead - behind) / (2 * step), atol=2e-3 * (1 + np.abs(W).max())
        )
        checked += 1
    assert checked > 250


def test_curvature_on_seams_and_axes() -> None:
    kind, size = kind_and_size("cylinder")
    assert surface.curvature(kind, size, 0.0, 0.0, 0.1, 0.0, 0.0, 1.0) == (0.0,) * 6
    kind, size = kind_and_size("sphere")
    assert surface.curvature(kind, size, 0.0, 0.0, -0.05, 0.0, 0.0, -1.0) == pytest.approx(
        (20, 0, 0, 20, 0, 0)
    )
    kind, size = kind_and_size("slab")
    assert surface.curvature(kind, size, 0.0, 0.0, 0.01, 0.0, 0.0, 1.0) == (0.0,) * 6
    # Its rim is half a cylinder all around, also where the normal is level.
    assert surface.curvature(kind, size, 0.05, 0.0, 0.0, 1.0, 0.0, 0.0) == pytest.approx((0, 0, 0, 0, 0, 100))


@pytest.mark.parametrize("name", NAMES)
def test_support_is_farthest(name: str) -> None:
    kind, size = kind_and_size(name)
    core, ball = core_and_ball(kind, size)
    for direction in np.random.default_rng(3).normal(size=(50, 3)):
        direction /= np.linalg.norm(direction)
        point = np.array(surface.support(kind, size, *direction))
        assert point @ direction == pytest.approx((core @ direction).max() + ball, abs=2e-5)
        assert surface.project(kind, size, *point)[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_kernels_run_uncompiled_alike(name: str) -> None:
    kind, size = kind_and_size(name)
    for point in np.random.default_rng(4).uniform(-0.2, 0.2, size=(20, 3)):
        plain = surface.project.py_func(kind, size, *point)
        np.testing.assert_allclose(plain, surface.project(kind, size, *point), atol=1e-14)


def test_pack_places_bodies_in_link_frames() -> None:
    links = [link("cone", "box"), link(), link("ellipsoid", "sphere", "capsule")]
    surfaces = surface.pack(links)
    assert surfaces.link.tolist() == [0, 0, 2, 2, 2]
    assert surfaces.start.tolist() == [0, 2, 2, 5]
    np.testing.assert_allclose(
        np.einsum("pji,pjk->pik", surfaces.rotation, surfaces.rotation), [np.eye(3)] * 5, atol=1e-15
    )
    assert np.linalg.det(surfaces.rotation) == pytest.approx(np.ones(5))
    cone = SHAPES["cone"]
    assert isinstance(cone, Cylinder)
    # The middle of cap b, seen in the body frame, is on the surface and its normal is the axis.
    cap = surfaces.rotation[0].T @ (np.array(cone.b) - surfaces.origin[0])
    distance, *_, nx, ny, nz = surface.project(int(surfaces.kind[0]), surfaces.size[0], *cap)
    assert distance == pytest.approx(0.0, abs=1e-12)
    assert (nx, ny, nz) == pytest.approx((0.0, 0.0, 1.0))
    for number in range(5):
        for direction in np.random.default_rng(5).normal(size=(50, 3)):
            far = surface.support(int(surfaces.kind[number]), surfaces.size[number], *direction)
            assert np.linalg.norm(far) <= surfaces.radius[number] + 1e-12


def test_pack_of_nothing() -> None:
    surfaces = surface.pack([link()])
    assert surfaces.kind.shape == (0,)
    assert surfaces.rotation.shape == (0, 3, 3)


def test_rounding_must_fit() -> None:
    with pytest.raises(FieldError, match="does not fit"):
        Cylinder(a=(0, 0, 0), b=(0, 0, 0.01), radius_a=0.05, radius_b=0.05, rounding=0.006)
    with pytest.raises(FieldError, match="does not fit"):
        Cylinder(a=(0, 0, 0), b=(0, 0, 0.1), radius_a=0.002, radius_b=0.05, rounding=0.01)
    with pytest.raises(FieldError, match="same point"):
        Cylinder(a=(0, 0, 0), b=(0, 0, 0), radius_a=0.002, radius_b=0.05, rounding=0.01)
