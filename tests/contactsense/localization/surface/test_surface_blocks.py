"""Blocks hold each sample once, their spheres all cells; skipping far ones changes no answer."""

import itertools

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.localization.surface.simd_layout import SPREAD, X, Y, Z
from contactsense.localization.surface.surface_blocks import CELL_REACH, surface_blocks
from contactsense.readings import forward_model
from contactsense.robots import load
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import pack
from contactsense.scene_model.constants import build_constants

SCENE = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(force_noise=0.5, moment_noise=0.1),
    joint_torque=JointTorqueSensor(noise=1.0),
)


def test_each_sample_is_in_one_lane_and_its_cell_in_the_sphere() -> None:
    constants = build_constants(SCENE)
    samples, blocks = constants.samples, constants.surface_blocks
    seen: list[int] = []
    for link, (first, last) in enumerate(itertools.pairwise(blocks.start)):
        for b in range(first, last):
            rows = blocks.sample[b, : blocks.length[b]]
            seen.extend(rows)
            assert (blocks.sample[b, len(rows) :] == rows[-1]).all()
            assert (constants.surfaces.link[samples.primitive[rows]] == link).all()
            for i, lane in enumerate((X, Y, Z)):
                np.testing.assert_array_equal(
                    blocks.cells[b, lane : lane + len(rows)], samples.point[rows, i]
                )
            np.testing.assert_array_equal(blocks.cells[b, SPREAD : SPREAD + len(rows)], samples.spread[rows])
            distance = np.linalg.norm(samples.point[rows] - blocks.centre[b], axis=1)
            assert (distance + CELL_REACH * samples.spread[rows] < blocks.radius[b] + 1e-12).all()
    assert sorted(seen) == list(range(len(samples.spread)))


def test_blocks_are_compact() -> None:
    """Spheres about samples that are near each other are small beside those about any of the same link."""
    constants = build_constants(SCENE)
    samples, blocks = constants.samples, constants.surface_blocks
    rng = np.random.default_rng(0)
    for first, last in itertools.pairwise(blocks.start):
        members = np.unique(blocks.sample[first:last])
        if len(members) < 8 * LANES:
            continue
        chosen = (samples.point[rng.choice(members, LANES, replace=False)] for _ in range(100))
        usual = np.median([0.5 * np.linalg.norm(np.ptp(points, axis=0)) for points in chosen])
        own = [0.5 * np.linalg.norm(np.ptp(samples.point[row], axis=0)) for row in blocks.sample[first:last]]
        assert np.median(own) < 0.5 * usual


def test_links_without_samples_have_no_blocks() -> None:
    constants = build_constants(SCENE)
    links = load("ur5e").links
    surfaces = pack(links)
    alone = constants.surfaces.link[constants.samples.primitive] == 2
    samples = constants.samples._replace(
        point=constants.samples.point[alone],
        normal=constants.samples.normal[alone],
        spread=constants.samples.spread[alone],
        tilt=constants.samples.tilt[alone],
        primitive=constants.samples.primitive[alone],
        start=np.searchsorted(constants.samples.primitive[alone], np.arange(len(surfaces.kind) + 1)),
    )
    blocks = surface_blocks(surfaces, samples)
    count = -(-int(alone.sum()) // LANES)
    np.testing.assert_array_equal(np.diff(blocks.start), [count if link == 2 else 0 for link in range(7)])


@pytest.mark.parametrize("seed", range(3))
def test_no_answer_changes_where_far_blocks_are_skipped(seed: int) -> None:
    rng = np.random.default_rng(seed)
    usual, all_blocks = Localizer(SCENE), Localizer(SCENE)
    all_blocks._buffers.constants.surface_blocks.radius[:] = 10.0
    samples = all_blocks._buffers.constants.samples
    for s in rng.choice(len(samples.spread), 40):
        q = rng.uniform(-2.0, 2.0, 6)
        link = int(all_blocks._buffers.constants.surfaces.link[samples.primitive[s]])
        force = -rng.uniform(5.0, 50.0) * samples.normal[s]
        exact = forward_model(SCENE, q, SCENE.link_names[link], samples.point[s], force, external=True)
        wrench = exact.base_wrench + rng.normal(size=6) * np.repeat([0.5, 0.1], 3)
        torque = exact.joint_torque + rng.normal(size=6)
        found, expected = (
            localizer.locate(q, base_wrench=wrench, joint_torque=torque) for localizer in (usual, all_blocks)
        )
        np.testing.assert_allclose(found.link_probability, expected.link_probability, atol=5e-3)
