"""The prior over links: what it must and must not change, and what is said of a wrong one."""

from typing import Any

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, SceneError, detectability
from contactsense.benchmarks.multi_contact.trials import Trials
from contactsense.robots import Robot
from contactsense.robots.primitives import Cylinder, Sphere
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.link_prior import area_share, link_probability, log_link_density
from contactsense.scene_model.scene_surfaces import touchable_links
from tests.plain_arm import plain_ur5e

ARM: Robot = plain_ur5e()
LINKS = ARM.link_names
WEIGHTS = dict(zip(LINKS, (3.0, 1.0, 2.0, 5.0, 1.0, 2.0, 4.0), strict=True))
PEDESTAL = Body(
    name="adapter",
    role="pedestal",
    primitives=(Cylinder(a=(0, 0, -0.2), b=(0, 0, 0), radius_a=0.1, radius_b=0.1, rounding=0.003),),
)


EXPECTED = "expected area, equal or a weight of each link by name"
SHARES = np.array([0.1, 0.15, 0.35, 0.25, 0.06, 0.06, 0.03, 0.05])
"""Made-up shares of the arm's links and of a tool in the area."""


def share_of(localizer: Localizer) -> np.ndarray:
    built = localizer._buffers.constants
    return area_share(built.surfaces, built.samples, len(LINKS))


def localizer(link_prior: Any) -> Localizer:
    """Its torques are so noisy that they hardly exclude a link."""
    return Localizer(Scene(robot=ARM, joint_torque=JointTorqueSensor(noise=10.0), link_prior=link_prior))


@pytest.fixture(scope="module")
def by_area() -> Localizer:
    return localizer("area")


def measurements(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Postures, and torques within their noise."""
    rng = np.random.default_rng(0)
    return [(rng.uniform(-2.0, 2.0, 6), rng.normal(0.0, 5.0, 6)) for _ in range(count)]


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"link_prior": "equal"}, [1, 1, 1, 1, 1, 1, 1]),
        ({"link_prior": WEIGHTS}, [3, 1, 2, 5, 1, 2, 4]),
        ({"link_prior": "equal", "touchable": LINKS[3:]}, [0, 0, 0, 1, 1, 1, 1]),
        ({"link_prior": {"forearm": 1.0, "wrist_3": 3.0}, "touchable": ("wrist_3", "forearm")},
         [0, 0, 0, 1, 0, 0, 3]),
        ({"link_prior": {"tool": 1, "wrist_1": 1}, "touchable": ("wrist_1", "tool"),
          "tool": Tool(primitives=(Sphere(center=(0, 0, 0.1), radius=0.03),))}, [0, 0, 0, 0, 1, 0, 0, 1]),
        ({"link_prior": {LINKS[0]: 1, "forearm": 2}, "touchable": ("forearm",), "bodies": (PEDESTAL,)},
         [1, 0, 0, 2, 0, 0, 0]),
    ],
)  # fmt: skip
def test_every_link_has_the_probability_that_the_scene_states(
    fields: dict[str, Any], expected: list[float]
) -> None:
    scene = Scene(robot=ARM, **fields)
    share = SHARES[: len(scene.link_names)] * touchable_links(scene)
    share /= share.sum()
    probability = link_probability(scene, share)
    np.testing.assert_allclose(probability, np.divide(expected, np.sum(expected)), atol=1e-12)
    # The density times the area.
    np.testing.assert_allclose(share * np.exp(log_link_density(scene, share)), probability, atol=1e-12)


def test_by_area_the_density_is_that_of_the_whole_surface(by_area: Localizer) -> None:
    share, scene = share_of(by_area), by_area.scene
    np.testing.assert_array_equal(by_area._buffers.constants.prior.log_link_density, np.zeros(len(LINKS)))
    np.testing.assert_array_equal(link_probability(scene, share), share)
    assert share.sum() == pytest.approx(1.0)


def test_the_sum_of_the_weights_is_arbitrary() -> None:
    one, thousand = (
        Scene(robot=ARM, link_prior={name: factor * weight for name, weight in WEIGHTS.items()})
        for factor in (1.0, 1000.0)
    )
    share = SHARES[:7] / SHARES[:7].sum()
    np.testing.assert_allclose(log_link_density(one, share), log_link_density(thousand, share), atol=1e-14)


@pytest.mark.slow
def test_weights_equal_to_the_areas_change_no_answer(by_area: Localizer) -> None:
    by_weight = localizer(dict(zip(LINKS, map(float, share_of(by_area)), strict=True)))
    rng = np.random.default_rng(1)
    for q in rng.uniform(-2.0, 2.0, (6, 6)):
        base, torque = rng.normal(0.0, (15, 15, 15, 5, 5, 5)), rng.normal(0.0, 20.0, 6)
        for given in ({"base_wrench": base}, {"joint_torque": torque}, {"base_wrench": base, "contacts": 2}):
            one, other = (of.locate(q, detect=False, **given) for of in (by_area, by_weight))
            assert one.status == other.status
            np.testing.assert_allclose(other.link_probability, one.link_probability, atol=1e-9)
            for a, b in zip(one.contacts, other.contacts, strict=True):
                np.testing.assert_allclose(b.point_base, a.point_base, atol=1e-9)
                assert b.probability == pytest.approx(a.probability, abs=1e-9)


def test_posterior_odds_change_by_the_odds_of_the_priors(by_area: Localizer) -> None:
    """Between links, and between a link and "none of these", whose prior stays as it is."""
    weighted = localizer(WEIGHTS)
    expected = np.append(log_link_density(weighted.scene, share_of(by_area)), 0.0)
    for q, torque in measurements(12):
        before, after = (
            of.locate(q, joint_torque=torque, detect=False).link_probability for of in (by_area, weighted)
        )
        before, after = (np.append(p, 1.0 - p.sum()) for p in (before, after))
        change = np.log(after / before)
        # Cells with less than exp(-8) of the best one's evidence are left out.
        np.testing.assert_allclose(change - change[-1], expected, atol=1e-3)


@pytest.mark.slow
def test_of_two_contacts_none_is_on_a_link_that_is_hardly_ever_touched() -> None:
    scene = Scene(robot=ARM, link_prior={**dict.fromkeys(LINKS, 1.0), LINKS[3]: 1e-9})
    localizer, trials = Localizer(scene), Trials(Scene(robot=ARM), seed=3)
    several = 0
    for _ in range(10):
        trial = trials.draw(2, 20.0, "different")
        base, torque = trial.measure(trial.pushes)
        estimate = localizer.locate(trial.q, base_wrench=base, joint_torque=torque, contacts=2, detect=False)
        assert estimate.link_probability[3] < 1e-3
        several += estimate.status == "multiple"
    assert several > 3


def test_a_link_of_weight_zero_is_one_that_cannot_be_touched() -> None:
    weights = {**WEIGHTS, "upper_arm": 0.0}
    rest = {name: weight for name, weight in weights.items() if weight > 0.0}
    without = localizer(weights)
    none = without._buffers.constants
    left_out = build_constants(Scene(robot=ARM, link_prior=rest, touchable=tuple(rest)))
    np.testing.assert_array_equal(none.touchable, left_out.touchable)
    np.testing.assert_array_equal(none.samples.point, left_out.samples.point)
    np.testing.assert_array_equal(none.prior.log_link_density, left_out.prior.log_link_density)
    assert none.prior.area == left_out.prior.area
    for q, torque in measurements(4):
        estimate = without.locate(q, joint_torque=torque, detect=False)
        assert estimate.link_probability[LINKS.index("upper_arm")] == 0.0
        assert "upper_arm" not in {contact.link for contact in estimate.contacts}


def test_a_pedestal_without_weight_cannot_be_touched() -> None:
    weights = dict.fromkeys(LINKS, 1.0)
    for weight in (1.0, 0.0):
        scene = Scene(robot=ARM, link_prior={**weights, LINKS[0]: weight}, bodies=(PEDESTAL,))
        assert touchable_links(scene)[0] == weight


def test_the_map_names_a_link_more_often_if_it_is_more_probable() -> None:
    q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
    sensors = {"base_wrench": None, "joint_torque": JointTorqueSensor(noise=2.0)}
    by_size, often = (
        detectability(Scene(robot=ARM, link_prior=prior, **sensors), q, every=24)
        for prior in ("area", {**dict.fromkeys(LINKS, 1.0), "wrist_2": 50.0})
    )
    on = by_size.link == LINKS.index("wrist_2")
    assert on.any()
    assert (often.link_probability[on] >= by_size.link_probability[on]).all()
    assert often.link_probability[on].mean() > by_size.link_probability[on].mean() + 0.1
    # What is felt, and the quantiles by area, do not depend on what is probable.
    np.testing.assert_array_equal(often.smallest_force, by_size.smallest_force)
    np.testing.assert_array_equal(often.share, by_size.share)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"link_prior": "size"}, f"link_prior: {EXPECTED}, got 'size'"),
        ({"link_prior": 3}, f"link_prior: {EXPECTED}, got 3"),
        ({"link_prior": {**WEIGHTS, "elbow": 1}},
         f"link_prior: expected touchable links of {', '.join(LINKS)}, got 'elbow'"),
        ({"link_prior": WEIGHTS, "touchable": ("forearm", "wrist_1")},
         f"link_prior: expected touchable links of forearm, wrist_1, got '{LINKS[0]}'"),
        ({"link_prior": {"forearm": 1.0}, "touchable": ("forearm", "wrist_1")},
         "link_prior: expected a weight of each touchable link, got none of wrist_1"),
        ({"link_prior": {**WEIGHTS, "forearm": -1}},
         "link_prior.forearm: expected a number of at least 0, got -1"),
        ({"link_prior": {**WEIGHTS, "forearm": float("nan")}}, "link_prior.forearm: .*got nan"),
        ({"link_prior": {**WEIGHTS, "forearm": "often"}}, "link_prior.forearm: .*got 'often'"),
        ({"link_prior": dict.fromkeys(LINKS, 0.0)}, "link_prior: expected a weight above 0, got none"),
    ],
)  # fmt: skip
def test_a_wrong_prior_is_explained_in_one_line(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=f"^{message}$") as caught:
        Scene(robot=ARM, **fields)
    assert "\n" not in str(caught.value)
