"""Blocks of samples: the same answers as one sample at a time."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from contactsense import Estimate, Localizer, SampleBlock, Scene
from contactsense.robots.primitives import Sphere
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import nearest
from contactsense.robots.tool import Tool
from contactsense.runtime.result_rows import FORCE, LINK, NORMAL, POINT, POINT_BASE, PROBABILITY, TORSION
from contactsense.sensors.settings import Friction, JointTorqueSensor, WrenchSensor
from contactsense.sensors.stream_state import DEGRADED, REPEATED, RESTARTED
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

PHASES = ("", "new", "hold", "slide")


@cache
def recording() -> SampleBlock:
    """The demo's script on the plain arm, its contacts moved onto that arm's surface: twelve seconds."""
    arm, script = plain_ur5e(), Script.demo()
    surfaces = pack(arm.links)
    contacts = []
    for contact in script.contacts:
        link = arm.link_names.index(contact.link)
        x, y, z = map(float, contact.point)
        found = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], (x, y, z))
        contacts.append(contact.model_copy(update={"point": found[2]}))
    motion = simulate(script.model_copy(update={"contacts": contacts}), arm)
    return SampleBlock(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench)[:6000]


def _with_faults(block: SampleBlock) -> SampleBlock:
    """The same with a silent sensor, a NaN, a repeated time, an unusable row and a clock set back."""
    t, torque, wrench, q = (
        array.copy()
        for array in (block.t, block.joint_torque, block.base_wrench, block.q)
        if array is not None
    )
    wrench[300:380] = np.nan
    torque[500, 2] = np.nan
    t[700] = t[699]
    q[800, 1] = np.nan
    t[4000:] -= 2.0
    return SampleBlock(t, q, block.qd, torque, wrench)


def agree(
    scene: Scene, block: SampleBlock, cut: Callable[[SampleBlock], list[SampleBlock]]
) -> list[Estimate]:
    one, many = Localizer(scene), Localizer(scene)
    estimates = list(one.run(block.sample(i) for i in range(len(block))))
    parts = list(many.run_blocks(cut(block)))
    assert sum(map(len, parts)) == len(block)
    start = 0
    for part in parts:
        rows = {int(i): [] for i in part.sample}
        for k, i in enumerate(part.sample):
            rows[int(i)].append(k)
        for i in range(len(part)):
            estimate = estimates[start + i]
            acting = estimate.contacts if estimate.status == "multiple" else estimate.contacts[:1]
            assert len(acting) == len(rows.get(i, []))
            assert bool(part.flags[i] & DEGRADED) or estimate.status != "degraded" or not estimate.contacts
            for contact, k in zip(acting, rows.get(i, []), strict=True):
                row = part.rows[k]
                assert (int(row[LINK]), part.contact[k]) == (contact.link_index, contact.id)
                assert PHASES[part.phase[i]] == contact.phase or estimate.status == "multiple"
                assert (row[PROBABILITY], row[TORSION]) == (contact.probability, contact.torsion)
                for place, value in (
                    (POINT, contact.point), (POINT_BASE, contact.point_base), (FORCE, contact.force_base),
                    (NORMAL, contact.normal_base),
                ):  # fmt: skip
                    np.testing.assert_array_equal(row[place], value)
                np.testing.assert_array_equal(part.link_probability[k], estimate.link_probability)
        start += len(part)
    assert sum(bool(estimate.contacts) for estimate in estimates) > 300
    return estimates


def test_blocks_give_the_answers_of_single_samples() -> None:
    agree(Scene(robot=plain_ur5e()), recording(), lambda block: [block])


def test_it_does_not_matter_where_blocks_are_cut() -> None:
    agree(
        Scene(robot=plain_ur5e()),
        _with_faults(recording()),
        lambda block: [block[:1], block[1:617], block[617:618], block[618:3000], block[3000:]],
    )


def test_faults_are_flagged() -> None:
    parts = list(Localizer(Scene(robot=plain_ur5e())).run_blocks([_with_faults(recording())]))
    flags = np.concatenate([part.flags for part in parts])
    assert flags[700] == REPEATED
    assert np.flatnonzero(flags & RESTARTED).tolist() == [4000]
    assert flags[379] & DEGRADED
    energy = np.concatenate([part.energy for part in parts])
    assert np.flatnonzero(np.isnan(energy)).tolist() == [700, 800]


@pytest.mark.parametrize("changes", [{"contacts": 2}, {"picks_up": True}])
def test_contacts_that_need_more_than_the_kernel_go_through_it_one_by_one(changes: dict[str, object]) -> None:
    agree(
        Scene(robot=plain_ur5e(), **changes), recording()[:4000], lambda block: [block[:1500], block[1500:]]
    )


def test_a_scene_without_a_base_sensor() -> None:
    block = recording()
    only = SampleBlock(block.t, block.q, block.qd, block.joint_torque)[:3000]
    agree(Scene(robot=plain_ur5e(), base_wrench=None), only, lambda block: [block])


def test_a_scene_with_friction_and_uncertain_masses() -> None:
    friction = Friction(coulomb=0.4, viscous=0.2, lubricant=0.1, load=0.01, error=0.5)
    torque = JointTorqueSensor(friction=friction, model_error=0.5, inertia_torque_error=0.1)
    scene = Scene(robot=plain_ur5e(), inertia_error=0.02, joint_torque=torque)
    agree(scene, _with_faults(recording())[:4000], lambda block: [block[:1001], block[1001:]])


def test_a_scene_with_a_wrist_sensor() -> None:
    block = recording()[:3000]
    noise = 0.05 * np.random.default_rng(3).standard_normal((3000, 6))
    noise[500:600] = np.nan
    tool = Tool(mass=0.01, primitives=(Sphere(center=(0.0, 0.0, 0.05), radius=0.03),))
    scene = Scene(robot=plain_ur5e(), wrist_wrench=WrenchSensor(), tool=tool)
    whole = SampleBlock(block.t, block.q, block.qd, block.joint_torque, block.base_wrench, noise)
    agree(scene, whole, lambda block: [block])


def test_residuals_without_contact_are_as_large_as_their_deviation() -> None:
    block = recording()
    (part,) = Localizer(Scene(robot=plain_ur5e())).run_blocks([block[:1000]])
    settled = slice(200, 900)
    assert not len(part.sample[part.sample < 900])
    for value, std in ((part.base_wrench, part.base_wrench_std), (part.joint_torque, part.joint_torque_std)):
        z = value[settled] / std[settled]
        assert 0.3 < np.sqrt(np.mean(z**2)) < 1.5
    assert repr(part).startswith("BlockEstimates(1000 samples")


def test_wrong_shapes_are_named() -> None:
    block = recording()[:10]
    with pytest.raises(ValueError, match=r"q: expected shape \(10, 6\), got shape \(10, 5\)"):
        list(
            Localizer(Scene(robot=plain_ur5e())).run_blocks([SampleBlock(block.t, block.q[:, :5], block.qd)])
        )


def test_a_single_block_is_named() -> None:
    """Else its rows would be taken for blocks, and the message would be about the shape of q."""
    with pytest.raises(TypeError, match=r"expected blocks, as in run_blocks\(\[block\]\), got a SampleBlock"):
        list(Localizer(Scene(robot=plain_ur5e())).run_blocks(recording()[:10]))  # type: ignore[arg-type]
    samples = [recording().sample(0)]
    with pytest.raises(TypeError, match=r"^recording\[0\]: expected a SampleBlock, got Sample$"):
        list(Localizer(Scene(robot=plain_ur5e())).run_blocks(samples))  # type: ignore[arg-type]
