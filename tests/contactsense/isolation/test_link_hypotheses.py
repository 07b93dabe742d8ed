"""The link recursion against dense linear algebra: one Gaussian per hypothesis, written down in full."""

import numpy as np
import pytest

from contactsense.isolation.link_hypotheses import (
    PRIOR_STD,
    Hypotheses,
    SensorRows,
    isolate,
)
from contactsense.robots.jit.flat_buffers import zeros

JOINTS = 6
LINKS = 8  # seven of the arm and a tool beyond the wrist sensor
FORCE, MOMENT, TORQUE = 0.7, 0.2, 0.9
WRIST = (0.4, 0.05)


def _case(seed: int) -> dict[str, np.ndarray]:
    chance = np.random.default_rng(seed)
    axis = chance.standard_normal((JOINTS, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    place = chance.uniform(-1, 1, (JOINTS, 3))
    return {
        "screw": np.hstack((np.cross(place, axis), axis)),
        "base": chance.standard_normal(6) * 20,
        "torque": chance.standard_normal(JOINTS) * 10,
        "wrist": chance.standard_normal(6) * 20,
        "origin": chance.uniform(-1, 1, 3),
        "forearm": chance.standard_normal(6) * 20,
    }


def _correlated() -> np.ndarray:
    """A covariance of the base wrench whose components are all correlated."""
    size, mixed = np.diag([FORCE] * 3 + [MOMENT] * 3), np.random.default_rng(7).standard_normal((6, 6))
    return size @ (np.eye(6) + mixed @ mixed.T) @ size


COVARIANCE = _correlated()
LOW_PASSED = np.linspace(0.5, 2.0, 18)
"""By how much a reading is larger for contacts that its sensor sees."""


def _about(o: np.ndarray) -> np.ndarray:
    """Matrix that moves a wrench from the base origin to the point o."""
    cross = np.array([[0, -o[2], o[1]], [o[2], 0, -o[0]], [-o[1], o[0], 0]])
    return np.block([[np.eye(3), np.zeros((3, 3))], [-cross, np.eye(3)]])


def _rows(case: dict[str, np.ndarray], has_torque: bool, sensors: dict[int, str]) -> SensorRows:
    """Rows of the joint torques, and of six-axis sensors: first link that each sees -> key of its wrench."""
    screw, value, variance, first = [], [], [], []
    if has_torque:
        screw += list(case["screw"])
        value += list(case["torque"])
        variance += [TORQUE**2] * JOINTS
        first += list(range(1, JOINTS + 1))
    for link, key in sensors.items():
        screw += list(_about(case["origin"]))
        value += list(_about(case["origin"]) @ case[key])
        variance += [WRIST[0] ** 2] * 3 + [WRIST[1] ** 2] * 3
        first += [link] * 6
    values = np.array(value)
    return SensorRows(
        np.array(screw).reshape(-1, 6),
        values,
        values + LOW_PASSED[: len(values)],
        np.array(variance),
        np.array(first, int),
    )


def _isolate(
    case: dict[str, np.ndarray],
    has_base: bool,
    rows: SensorRows,
    ratio: float,
    out: Hypotheses,
    covariance: np.ndarray = COVARIANCE,
) -> None:
    isolate(covariance, np.linalg.inv(covariance), case["base"], has_base, rows, len(rows.value), ratio, out)


def _dense(
    case: dict[str, np.ndarray], link: int, has_base: bool, has_torque: bool, sensors: dict[int, str]
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Fused wrench, covariance, energy and log evidence from the joint Gaussian of everything but the
    base."""
    measured = _rows(case, has_torque, sensors)
    seen = measured.first_link <= link
    rows, variances = measured.screw * seen[:, None], measured.variance
    values = np.where(seen, measured.proximal_value, measured.value)
    mean = case["base"] if has_base else np.zeros(6)
    prior = COVARIANCE if has_base else PRIOR_STD**2 * np.eye(6)
    A, y, R = np.array(rows).reshape(-1, 6), np.array(values), np.diag(variances)
    if len(y) == 0:
        return mean, prior, 0.0, 0.0
    S = A @ prior @ A.T + R
    # Information form: without base sensor the covariance falls from 1e6 to below 1, where differences lose
    # digits.
    covariance = np.linalg.inv(np.linalg.inv(prior) + A.T @ np.linalg.solve(R, A))
    innovation = y - A @ mean
    return (
        mean + covariance @ A.T @ np.linalg.solve(R, innovation),
        covariance,
        0.5 * innovation @ np.linalg.solve(S, innovation),
        -0.5 * (innovation @ np.linalg.solve(S, innovation) + np.linalg.slogdet(2.0 * np.pi * S)[1]),
    )


@pytest.mark.parametrize("has_base", [True, False])
@pytest.mark.parametrize("has_torque", [True, False])
@pytest.mark.parametrize("sensors", [{}, {JOINTS + 1: "wrist"}, {3: "forearm"}, {3: "forearm", 7: "wrist"}])
@pytest.mark.parametrize("seed", range(3))
def test_every_subset_of_sensors_equals_the_dense_gaussian(
    has_base: bool, has_torque: bool, sensors: dict[int, str], seed: int
) -> None:
    case, out = _case(seed), zeros(Hypotheses, links=LINKS)
    _isolate(case, has_base, _rows(case, has_torque, sensors), 1.0, out)
    for link in range(LINKS):
        wrench, covariance, energy, evidence = _dense(case, link, has_base, has_torque, sensors)
        scale = 1.0 if has_base else PRIOR_STD**2 * 1e-3
        np.testing.assert_allclose(out.wrench[link], wrench, rtol=1e-7, atol=1e-7 * scale)
        np.testing.assert_allclose(out.covariance[link], covariance, rtol=1e-6, atol=1e-8 * scale)
        assert out.energy[link] == pytest.approx(energy, rel=1e-7, abs=1e-8)
        assert out.log_evidence[link] == pytest.approx(evidence, rel=1e-7, abs=1e-6)
        information = np.linalg.inv(covariance)
        np.testing.assert_allclose(
            out.information[link], information, rtol=1e-5, atol=1e-6 * np.abs(information).max()
        )


def test_scaled_noise_is_the_same_as_scaled_sensors() -> None:
    case, scaled, direct = _case(9), zeros(Hypotheses, links=LINKS), zeros(Hypotheses, links=LINKS)
    rows = _rows(case, True, {JOINTS + 1: "wrist"})
    _isolate(case, True, rows, 0.25, scaled)
    _isolate(case, True, rows, 1.0, direct, COVARIANCE / 4)
    for a, b in zip(scaled, direct, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_the_torques_decide_for_the_touched_link_where_they_can() -> None:
    """A contact wrench on link k leaves the joints beyond k still: exactly known torques tell k at once."""
    case, out = _case(5), zeros(Hypotheses, links=LINKS)
    w = case["base"]
    for link in range(JOINTS + 1):
        torque = np.where(np.arange(JOINTS) < link, case["screw"] @ w, 0.0)
        rows = _rows(case | {"torque": torque}, True, {})
        exact = rows._replace(proximal_value=rows.value, variance=rows.variance * 1e-6)
        _isolate(case, True, exact, 1e-6, out)
        assert int(np.argmax(out.log_evidence[: JOINTS + 1])) == link


def test_many_precise_sensors_do_not_underflow() -> None:
    """The product of their variances is far below the smallest number."""
    case, out = _case(3) | {"base": np.zeros(6)}, zeros(Hypotheses, links=LINKS)
    rows = _rows(case, True, {2: "forearm", 7: "wrist"})
    many = SensorRows(*(np.concatenate([array] * 6) for array in rows))
    nothing, variance = np.zeros(len(many.value)), many.variance * 1e-10
    many = many._replace(value=nothing, proximal_value=nothing, variance=variance)
    _isolate(case, True, many, 1.0, out)
    for link in range(LINKS):
        seen = many.screw * (many.first_link <= link)[:, None]
        more = np.linalg.slogdet(np.eye(6) + COVARIANCE @ (seen.T / variance) @ seen)[1]
        expected = -0.5 * (np.log(2.0 * np.pi * variance).sum() + more)
        assert out.log_evidence[link] == pytest.approx(expected, rel=1e-7)
