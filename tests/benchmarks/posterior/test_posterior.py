"""The dense posterior: evidence against brute force with NumPy, samples of known bodies, answers to truth."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.benchmarks.peers.cases import answer, score, static_cases
from contactsense.benchmarks.posterior.bootstrap import ratio
from contactsense.benchmarks.posterior.dense import Dense
from contactsense.benchmarks.posterior.evidence import Prior, eliminate, gram, over_force
from contactsense.benchmarks.posterior.patch_posterior import (
    empty_measurement,
    mean_on_patch,
    wrench_in_link_frame,
)
from contactsense.benchmarks.posterior.samples import Samples, of_primitives
from contactsense.benchmarks.posterior.table import Skins, rows, table
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.benchmarks.static_truth.points import read, select
from contactsense.localization.surface.surface_samples import surface_patches
from contactsense.scene_model.constants import build_constants
from tests.shared import shared

pytestmark = pytest.mark.slow  # its kernels compile for long


def case_at_random(seed: int, sharp: bool) -> tuple[np.ndarray, ...]:
    """Information, wrench, place, normal, taken force: a push with friction and torsion, measured or not."""
    rng = np.random.default_rng(seed)
    c = rng.normal(scale=0.2, size=3)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    F = math.exp(rng.uniform(math.log(5.0), math.log(60.0)))
    across = np.cross(n, rng.normal(size=3))
    f = -F * n + rng.uniform(0.0, 0.4) * F * across / np.linalg.norm(across)
    w = np.concatenate((f, np.cross(c, f) + 0.002 * F * n))
    root = rng.normal(size=(6, 6)) * (0.1 if sharp else 1.0) * np.repeat([1.0, 0.2], 3)[:, None]
    if not sharp:
        # Three of six directions are not measured, as with joint torques alone.
        root[:, :3] *= 1e3
    P = root @ root.T + np.diag([0.1**2] * 3 + [0.02**2] * 3)
    return np.linalg.inv(P), w + np.linalg.cholesky(P) @ rng.normal(size=6), c, n, f


def brute(
    L: np.ndarray, w: np.ndarray, c: np.ndarray, n: np.ndarray, f: np.ndarray, spread: float, prior: Prior
) -> float:
    """Log of the integral over log F of the Gaussian density of w, but for the density of P alone at 0."""
    t1 = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0])
    t1 /= np.linalg.norm(t1)
    t2 = np.cross(n, t1)
    # Of the measurement whitened by L, of which P itself, with numbers of all sizes, would lose digits.
    root = np.linalg.cholesky(L).T

    def push(direction: np.ndarray) -> np.ndarray:
        return np.concatenate((direction, np.cross(c, direction)))

    def turn(moment: np.ndarray) -> np.ndarray:
        return np.concatenate((np.zeros(3), moment))

    sizes = (spread, spread, prior.surface_deviation)
    places = [sd * turn(np.cross(direction, f)) for sd, direction in zip(sizes, (t1, t2, n), strict=True)]
    grown = [
        prior.friction_ratio * push(t1),
        prior.friction_ratio * push(t2),
        prior.torsion_lever * turn(n),
    ]
    values = np.linspace(math.log(prior.low), math.log(prior.high), 3001)
    terms = np.empty(len(values))
    for i, F in enumerate(np.exp(values)):
        spreads = root @ np.column_stack([*places, *(F * u for u in grown)])
        whole = np.eye(6) + spreads @ spreads.T
        e = root @ (w + F * push(n))
        terms[i] = -0.5 * (np.linalg.slogdet(whole)[1] + e @ np.linalg.solve(whole, e))
    return float(terms.max() + math.log(np.exp(terms - terms.max()).mean()))


def prior(offset: float = 0.002) -> Prior:
    return Prior(1.0, 300.0, 0.25, 0.0025, offset)


@pytest.mark.parametrize("sharp", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_evidence_of_a_patch_is_that_of_dense_linear_algebra(seed: int, sharp: bool) -> None:
    L, w, c, n, f = case_at_random(seed, sharp)
    M = np.zeros((8, 8))
    gram(L, w, c, n, f, 0.001, 0.002, M)
    half = eliminate(M)
    value, F = over_force(M, prior(), float(np.linalg.norm(f)), -math.inf)
    assert value - half == pytest.approx(brute(L, w, c, n, f, 0.001, prior()), abs=0.01)
    assert not sharp or 0.7 < F / -(f @ n) < 1.3


def test_hopeless_patches_are_dropped() -> None:
    L, w, c, n, f = case_at_random(2, True)
    M = np.zeros((8, 8))
    gram(L, w, c, n, f, 0.001, 0.002, M)
    eliminate(M)
    value = over_force(M, prior(), 20.0, -math.inf)[0]
    assert over_force(M, prior(), 20.0, value - 20.0)[0] == value
    assert over_force(M, prior(), 20.0, value + 20.0)[0] == -math.inf


def test_the_place_on_a_patch_is_the_mean_of_its_displacements() -> None:
    """A push straight down on z = 0, measured 1 mm beside the middle of a patch of 4 mm."""
    samples = Samples(
        point=np.zeros((1, 3)),
        normal=np.array([[0.0, 0.0, 1.0]]),
        area=np.full(1, 1.6e-5),
        spread=np.full(1, 0.00115),
        covered=np.zeros((1, 2, 4), dtype=bool),
        start=np.array([0, 1]),
    )
    f = np.array([0.0, 0.0, -20.0])
    at = np.array([0.001, -0.0005, 0.0])
    w = np.concatenate((f, np.cross(at, f)))
    noise = np.array([0.05] * 3 + [0.01] * 3)
    place, local = np.zeros(3), empty_measurement()._replace(wrench=w, information=np.diag(noise**-2.0))
    mean_on_patch(samples, 0, 20.0, True, prior(0.0), local, place)
    gain = 0.00115**2 / (0.00115**2 + (0.01 / 20.0) ** 2)
    assert place == pytest.approx(gain * at, rel=1e-3, abs=1e-9)


def test_a_wrench_is_brought_into_a_links_frame_with_its_information() -> None:
    """The energy of any other wrench stays what it was."""
    rng = np.random.default_rng(4)
    R, o = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    root = rng.normal(size=(6, 6))
    w, other = rng.normal(size=(2, 6))
    local = empty_measurement()
    wrench_in_link_frame(w, root @ root.T, R, o, local)
    seen = np.concatenate((R.T @ other[:3], R.T @ (other[3:] - np.cross(o, other[:3]))))
    d = seen - local.wrench
    assert d @ local.information @ d == pytest.approx((other - w) @ root @ root.T @ (other - w))


@pytest.fixture(scope="module")
def coarse() -> Samples:
    return of_primitives(Scene(robot="ur5e", detail="coarse"), spacing=0.01)


def test_samples_lie_on_the_surface_and_add_up_to_it(coarse: Samples) -> None:
    scene = Scene(robot="ur5e", detail="coarse")
    assert len(coarse.start) == len(scene.link_names) + 1
    assert np.linalg.norm(coarse.normal, axis=1) == pytest.approx(1.0)
    # A shell of 0.9 m, about 0.1 m across.
    assert 0.3 < coarse.area.sum() < 0.9
    assert np.median(coarse.area) == pytest.approx(0.01**2, rel=0.5)
    assert np.median(coarse.spread) < 0.004
    assert 0.0 < coarse.covered.mean() < 0.3


def test_finer_samples_have_the_same_area(coarse: Samples) -> None:
    finer = of_primitives(Scene(robot="ur5e", detail="coarse", touchable=("forearm",)), spacing=0.006, seed=1)
    own = slice(coarse.start[3], coarse.start[4])
    assert finer.start[-1] == finer.start[4]
    assert finer.area.sum() == pytest.approx(coarse.area[own].sum(), rel=0.02)


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_each_link_has_the_area_that_the_localizer_sees(robot: str) -> None:
    """Edges, rims and caps included. Base and last wrist have slits, half of which the localizer counts."""
    scene = Scene(robot=robot)
    samples, surfaces = of_primitives(scene, spacing=0.01), build_constants(scene).surfaces
    for link in range(1, 6):
        own = samples.area[samples.start[link] : samples.start[link + 1]].sum()
        assert own == pytest.approx(surface_patches(surfaces, link).area.sum(), rel=0.03)
    # Nothing touches the face that the base stands on.
    base = slice(0, samples.start[1])
    assert not np.any((samples.point[base, 2] < 0.001) & (samples.normal[base, 2] < -0.9))


@pytest.mark.parametrize(("sensors", "share"), [("all", 0.95), ("base", 0.8), ("torques", 0.5)])
def test_answers_to_ground_truth(coarse: Samples, sensors: str, share: float) -> None:
    """On one or two bodies a link, 10 mm apart: the force's axis alone passes through several of them."""
    case = next(static_cases("ur5e", COLUMNS[:1], [sensors], "coarse", slice(0, 60), shared("truth")))
    method = Dense(case.scene, "primitives", coarse)
    answers, _ = answer(method, case)
    found = score(answers, case.points)
    assert found.link_right >= share
    if sensors != "torques":
        assert found.median < 0.005
    assert answers.link_probability is not None
    assert answers.link_probability.sum(axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("rule", ["mean", "middle"])
def test_both_rules_answer_near_the_truth_where_all_is_clear(coarse: Samples, rule: str) -> None:
    case = next(static_cases("ur5e", COLUMNS[:1], ["all"], "coarse", slice(0, 20), shared("truth")))
    method = Dense(case.scene, "primitives", coarse, rule)  # type: ignore[arg-type]
    answers, _ = answer(method, case)
    assert score(answers, case.points).median < 0.006


def test_the_table_has_the_ratios(coarse: Samples) -> None:
    points = select(read(shared("truth"), "ur5e"), slice(0, 30))
    skins = Skins({"primitives": coarse})
    found = list(rows(points, ["all"], "coarse", shared("ur_visual"), skins, COLUMNS[:1]))
    assert [row.contacts for row in found] == [30]
    median = found[0].median["primitives"]
    assert median.found == found[0].ours.median / found[0].dense["primitives"].median
    assert median.low <= median.found <= median.high
    assert found[0].p95["primitives"].found > 0.0
    assert found[0].as_json()["dense"]["primitives"]["link_right"] == found[0].dense["primitives"].link_right
    console = Console(width=192, file=io.StringIO())
    console.print(table(found, "primitives", "coarse"))
    assert str(median) in console.file.getvalue()


def test_ratios_are_of_the_same_contacts() -> None:
    """Errors that are a fifth larger on every contact: no chance is left, however uneven they are."""
    best = np.random.default_rng(0).exponential(size=50)
    for quantile in (0.5, 0.95):
        assert ratio(1.2 * best, best, quantile) == pytest.approx((1.2, 1.2, 1.2))


def test_ratios_of_independent_errors_are_within_their_interval() -> None:
    """Of two methods that are equally good: 95 % of the intervals hold 1."""
    rng = np.random.default_rng(1)
    held = [
        found.low <= 1.0 <= found.high
        for found in (ratio(*rng.exponential(size=(2, 80)), 0.5) for _ in range(60))
    ]
    assert np.mean(held) > 0.85
    assert not ratio(np.full(9, np.inf), np.ones(9), 0.5).found < np.inf
