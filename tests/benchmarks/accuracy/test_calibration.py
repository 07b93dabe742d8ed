"""The calibration bench on cases whose answer is known: true probabilities, overstated ones, regions."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Contact
from contactsense.benchmarks.accuracy.calibration import NEAR, Share, calibration, judge, summarize, verdict
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.benchmarks.static_truth.points import read, select
from contactsense.benchmarks.statistics.credible_regions import distance, explains, level, mixture, within
from contactsense.benchmarks.statistics.reliability import reliability
from tests.shared import shared


def contact(
    probability: float,
    point: tuple[float, float, float],
    sd: tuple[float, float] = (0.01, 0.01),
    link: int = 1,
) -> Contact:
    """An explanation on a face z = const, with standard deviations along x and y and 2 mm across."""
    place = np.array(point)
    return Contact(
        link=f"link {link}",
        link_index=link,
        primitive=0,
        probability=probability,
        point=place,
        point_base=place,
        normal_base=np.array([0.0, 0.0, 1.0]),
        force_base=np.array([0.0, 0.0, -10.0]),
        torsion=0.0,
        covariance=np.diag([sd[0] ** 2, sd[1] ** 2, 0.002**2]),
    )


def test_true_probabilities_have_no_error_but_chance() -> None:
    rng = np.random.default_rng(1)
    stated = rng.uniform(0.0, 1.0, 20000)
    told = reliability(stated, rng.random(20000) < stated)
    assert told.by_chance < 0.01
    assert told.error < 2.0 * told.by_chance
    assert sum(entry.samples for entry in told.bins) == 20000


def test_chance_is_what_true_probabilities_show() -> None:
    """Two hundred sure statements and a hundred of any probability, fifty times: their errors are about
    chance's mean, few above its limit. Sure ones that are wrong in 15 % of the cases are above it."""
    rng = np.random.default_rng(3)
    stated = np.concatenate([np.full(200, 0.99), rng.uniform(0.0, 1.0, 100)])
    drawn = [reliability(stated, rng.random(300) < stated) for _ in range(50)]
    told = drawn[0]
    assert np.mean([one.error for one in drawn]) == pytest.approx(told.by_chance, rel=0.15)
    assert np.mean([one.error > told.by_chance_95 for one in drawn]) < 0.15
    overstated = np.concatenate([np.full(200, 0.85), stated[200:]])
    assert reliability(stated, rng.random(300) < overstated).error > told.by_chance_95


def test_shares_have_the_interval_of_their_count() -> None:
    """Wilson's closed form, at p = 0.9 of 2000 and where nothing was wrong."""
    z = 1.959964
    for right, samples in ((1800, 2000), (20, 20)):
        p = right / samples
        middle = (p + z**2 / (2 * samples)) / (1 + z**2 / samples)
        half = z / (1 + z**2 / samples) * np.sqrt(p * (1 - p) / samples + z**2 / (4 * samples**2))
        assert Share.of(right, samples) == pytest.approx((p, middle - half, middle + half))
    assert np.isnan(Share.of(0, 0)).all()


def test_overstated_probabilities_show_by_how_much() -> None:
    right = np.tile([True, True, True, False], 100)
    told = reliability(np.full(400, 0.95), right)
    assert told.error == pytest.approx(0.2)
    assert [(b.low, b.samples, b.right) for b in told.bins] == [(0.9, 400, 0.75)]
    assert reliability(np.array([1.0]), np.array([True])).error == 0.0


def test_errors_of_opposite_sign_in_two_bins_do_not_cancel() -> None:
    stated = np.repeat([0.25, 0.75], 100)
    assert reliability(stated, np.repeat([True, False], 100)).error == pytest.approx(0.75)


@pytest.mark.parametrize("sd", [(0.01, 0.01), (0.05, 0.002)])
def test_levels_of_the_truth_are_uniform_where_the_mixture_is_true(sd: tuple[float, float]) -> None:
    """Two explanations on one link and one on another; the truth is drawn from them."""
    contacts = [
        contact(0.5, (0, 0, 0.5), sd),
        contact(0.3, (0.02, 0, 0.5), sd),
        contact(0.2, (0, 0, 0.2), sd, 2),
    ]
    told = mixture(contacts)
    rng = np.random.default_rng(2)
    levels = []
    for which in rng.choice(3, size=2000, p=told.weight):
        c = contacts[which]
        point = c.point_base + rng.normal(size=3) * [*sd, 0.0]
        levels.append(level(told, c.link_index, point))
    for share in (0.1, 0.5, 0.9):
        assert np.mean(np.array(levels) < share) == pytest.approx(share, abs=0.035)


def test_what_no_explanation_reaches_is_in_no_region() -> None:
    told = mixture([contact(0.6, (0, 0, 0.5))])
    assert level(told, 2, np.array([0.0, 0.0, 0.5])) == 1.0
    assert level(told, 1, np.array([0.0, 0.0, 0.5])) < 0.05
    # Right below, on the far side of the link.
    assert level(told, 1, np.array([0.0, 0.0, 0.3])) == 1.0
    # A region of 90 % that the list cannot fill holds what the list has, no more.
    assert level(told, 1, np.array([0.03, 0.0, 0.5])) == pytest.approx(0.6 * (1.0 - np.exp(-4.5)), abs=0.01)


def test_distances_are_in_standard_deviations_along_the_surface() -> None:
    told = mixture([contact(1.0, (0, 0, 0), (0.02, 0.01))])
    points = np.array([[0.02, 0.0, 0.004], [0.0, 0.02, -0.004], [0.02, 0.01, 0.0]])
    assert distance(told, 1, points)[0] == pytest.approx([1.0, 2.0, np.sqrt(2.0)])
    assert np.isinf(distance(told, 2, points)).all()


def test_an_answer_that_goes_around_a_link_reaches_its_far_side() -> None:
    """A cylinder of 60 mm across, any place around it alike: the far side is as near as the covariance along
    the normal says."""
    around = contact(1.0, (0, 0, 0.03), (0.03 / np.sqrt(2.0), 0.05))
    around.covariance[2, 2] = 0.045**2
    told = mixture([around])
    far = np.array([[0.0, 0.0, -0.03]])
    assert distance(told, 1, far)[0] == pytest.approx([0.0])
    assert np.isinf(distance(told, 1, far - [0.0, 0.0, 0.05])).all()


def test_the_ellipse_of_99_9_percent_is_one_along_the_normal_too() -> None:
    around = contact(1.0, (0, 0, 0), (0.02, 0.02))
    around.covariance[2, 2] = 0.03**2
    told = mixture([around])
    for depth, inside in ((2.5, True), (3.2, True), (3.4, False)):
        assert explains(told, 1, np.array([[0.0, 0.0, -depth * 0.03]]))[0, 0] == inside
    assert explains(told, 1, np.array([[3.6 * 0.02, 0.0, 0.0], [3.8 * 0.02, 0.0, 0.0]]))[0].tolist() == [
        True,
        False,
    ]
    assert not explains(told, 2, np.zeros((1, 3))).any()


def test_probability_near_a_place_is_the_mixtures() -> None:
    told = mixture([contact(0.7, (0, 0, 0)), contact(0.1, (0.3, 0, 0)), contact(0.2, (0, 0, 0), link=2)])
    inside = 1.0 - np.exp(-0.5 * (NEAR / 0.01) ** 2)
    assert within(told, 1, np.zeros(3), NEAR) == pytest.approx(0.7 * inside, abs=0.01)


def test_an_estimate_is_judged_by_link_place_and_region() -> None:
    contacts = [contact(0.7, (0, 0, 0)), contact(0.25, (0.1, 0, 0)), contact(0.05, (0, 0, 0), link=2)]
    links = np.array([0.0, 0.95, 0.05])
    at_best = verdict(contacts, links, 1, np.array([0.005, 0.0, 0.0]))
    assert at_best is not None
    assert at_best.answer[:2] == (0.7, True)
    assert at_best.answer[2] == pytest.approx(0.7, abs=0.005)
    assert at_best.link == (0.95, True, 0.95)
    assert at_best.place[1]
    assert at_best.in_region
    assert at_best.in_ellipse is True
    at_second = verdict(contacts, links, 1, np.array([0.1, 0.0, 0.0]))
    assert at_second is not None
    assert at_second.answer[:2] == (0.7, False)
    assert at_second.link == (0.95, True, 0.95)
    assert not at_second.place[1]
    assert at_second.in_region
    assert at_second.in_ellipse is None
    # At the middle of the third the density is above the level that 90 % need, 0.1 / 3 of the peak; not here.
    elsewhere = verdict(contacts, links, 2, np.array([0.02, 0.0, 0.0]))
    assert elsewhere is not None
    assert elsewhere.answer[:2] == (0.7, False)
    assert elsewhere.link == (0.95, False, 0.95)
    assert not elsewhere.in_region
    assert verdict([], links, 1, np.zeros(3)) is None


@pytest.mark.slow
def test_truths_drawn_from_overlapping_candidates_are_judged_as_often_as_expected() -> None:
    """The truth of one may be nearer to the other, so even true probabilities show a difference."""
    contacts = [contact(0.8, (0, 0, 0)), contact(0.2, (0.015, 0, 0))]
    rng = np.random.default_rng(4)
    judged = []
    for which in rng.choice(2, size=2000, p=[0.8, 0.2]):
        point = contacts[which].point_base + rng.normal(size=3) * [0.01, 0.01, 0.0]
        judged.append(verdict(contacts, np.array([0.0, 1.0]), 1, point))
    right = [given.answer[1] for given in judged if given is not None]
    expected = [given.answer[2] for given in judged if given is not None]
    assert expected[0] < 0.72
    assert np.mean(right) == pytest.approx(expected[0], abs=0.03)
    assert set(expected) == {expected[0]}
    stated = np.full(2000, 0.8)
    assert reliability(stated, np.array(right)).error > 0.05
    told = reliability(stated, np.array(right), np.array(expected))
    assert told.error == pytest.approx(told.by_chance, abs=0.03)


def test_no_answer_is_in_no_region() -> None:
    given = verdict([contact(1.0, (0, 0, 0))], np.array([0.0, 1.0]), 1, np.zeros(3))
    found = summarize("ur5e", "all", COLUMNS[0], [given, None])
    assert (found.no_answer, found.region.found, found.ellipse.found) == (0.5, 0.5, 1.0)
    assert found.statements["answer"].error == 0.0


def test_verdicts_on_ground_truth() -> None:
    """Sharp measurements: nearly all is certain, and right."""
    points = select(read(shared("truth"), "ur5e"), slice(0, 200))
    found = summarize("ur5e", "all", COLUMNS[0], judge(points, COLUMNS[0]))
    assert found.samples == 200
    assert found.statements["link"].bins[-1].right > 0.97
    assert found.statements["link"].error < 0.03


def test_the_command_prints_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with np.load(shared("truth/static_points_ur5e.npz")) as data:
        rows = {
            key: value[:20] if value.ndim and len(value) == 2000 else value for key, value in data.items()
        }
    np.savez(tmp_path / "static_points_ur5e.npz", **rows)
    command = [str(tmp_path), "--robot", "ur5e", "--sensors", "all", "--json"]
    done = CliRunner().invoke(calibration, command, catch_exceptions=False)
    assert done.exit_code == 0
    results = json.loads(done.stdout)["results"]
    assert [r["noise"]["torque"] for r in results] == [0.0, 0.3, 1.0, 3.0]
    assert all(sum(b["samples"] for b in r["statements"]["link"]["bins"]) == 20 for r in results)
    monkeypatch.setattr("contactsense.benchmarks.accuracy.calibration.COLUMNS", COLUMNS[:1])
    table = CliRunner().invoke(calibration, command[:-1], catch_exceptions=False)
    assert "place: stated -> right" in table.stdout


def test_skin_needs_meshes(tmp_path: Path) -> None:
    done = CliRunner().invoke(calibration, [str(tmp_path), "--detail", "skin"])
    assert done.exit_code == 2
    assert "--detail skin needs --meshes" in done.output


def test_the_log_score_is_the_mean_log_probability_of_what_came_true() -> None:
    found = reliability(np.array([0.9, 0.6, 1.0]), np.array([True, False, True]))
    assert found.log_score == pytest.approx(np.mean(np.log([0.9, 0.4, 1.0 - 1e-4])))
    assert found.as_json()["log_score"] == found.log_score
    assert np.isfinite(reliability(np.array([1.0]), np.array([False])).log_score)
