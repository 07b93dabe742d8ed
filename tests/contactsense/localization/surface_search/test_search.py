"""The search over the surface returns points on the surface."""

import math
from typing import Literal

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.localization.surface_search.surface_evidence import evaluate_cells
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import distances
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF
from tests.contactsense.localization.latest_search import latest_search
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 40, seed=8)


@pytest.mark.parametrize("sensors", ["torques", "base"])
def test_every_candidate_lies_on_the_surface(sensors: str) -> None:
    by_base = sensors == "base"
    scene = Scene(
        robot=ARM,
        base_wrench=WrenchSensor(force_noise=2.0, moment_noise=0.5) if by_base else None,
        joint_torque=None if by_base else JointTorqueSensor(noise=0.5),
    )
    localizer, surfaces = Localizer(scene), pack(ARM.links)
    count = 0
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        estimate = localizer.locate(
            q, base_wrench=wrench if by_base else None, joint_torque=None if by_base else torque
        )
        assert estimate.link_probability.sum() <= 1.0 + 1e-9
        for contact in estimate.contacts:
            count += 1
            distance = distances(surfaces, contact.point[None], contact.link_index)[0]
            assert abs(distance[0]) < 1e-6
            assert abs(np.linalg.norm(contact.normal_base) - 1.0) < 1e-9
            assert np.linalg.eigvalsh(contact.covariance).min() > -1e-12
    assert count > len(TRUTH.q)


@pytest.mark.parametrize("detail", ["fine", "coarse"])
@pytest.mark.parametrize("sensors", ["torques", "base", "all"])
@pytest.mark.parametrize("level", [0.1, 1.0, 4.0])
def test_every_candidate_is_pushed(sensors: str, detail: Literal["fine", "coarse"], level: float) -> None:
    scene = Scene(
        robot="ur5e",
        detail=detail,
        base_wrench=None
        if sensors == "torques"
        else WrenchSensor(force_noise=0.25 * level, moment_noise=0.05 * level),
        joint_torque=None if sensors == "base" else JointTorqueSensor(noise=level),
    )
    localizer, rng = Localizer(scene), np.random.default_rng(3)
    count = 0
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        noisy = torque + level * rng.standard_normal(6)
        estimate = localizer.locate(
            q,
            base_wrench=None if sensors == "torques" else wrench,
            joint_torque=None if sensors == "base" else noisy,
            detect=False,
        )
        for contact in estimate.contacts:
            count += 1
            assert contact.force_base @ contact.normal_base < 0.0
    assert count > len(TRUTH.q) / 2


def test_a_pure_moment_is_handled_without_warnings() -> None:
    estimate = Localizer(Scene(robot="ur5e", joint_torque=None)).locate(
        np.zeros(6), base_wrench=np.array([0.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    )
    assert estimate.status in ("none", "ambiguous")
    assert np.isfinite(estimate.link_probability).all()


@pytest.mark.slow
@pytest.mark.parametrize(("above", "fewer"), [(0.0, False), (20.0, True)])
def test_only_what_is_hopeless_beside_something_else_is_not_evaluated(above: float, fewer: bool) -> None:
    scene = Scene(
        robot=ARM,
        base_wrench=WrenchSensor(force_noise=1.0, moment_noise=0.2),
        joint_torque=JointTorqueSensor(noise=1.0),
    )
    localizer = Localizer(scene)
    state = localizer._buffers.state
    problem, arrays = latest_search(localizer)
    rows = np.zeros(2, dtype=int)
    for q, wrench, torque in zip(TRUTH.q, TRUTH.base_wrench, TRUTH.torque, strict=True):
        localizer.locate(q, base_wrench=wrench, joint_torque=torque)
        found: list[np.ndarray] = []
        competing_energy = math.inf
        for k in range(2):
            count, best, _ = evaluate_cells(problem, arrays, competing_energy)
            found.append(state.surface_cells.score[:count].copy())
            rows[k] += count
            competing_energy = -best - above
        alone, beside = (np.exp(scores + competing_energy).sum() for scores in found)
        np.testing.assert_allclose(beside, alone, atol=np.exp(-ENERGY_CUTOFF))
    assert (rows[1] < rows[0]) == fewer
