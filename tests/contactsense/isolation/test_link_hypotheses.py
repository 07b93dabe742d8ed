"""The link recursion against dense linear algebra: one Gaussian per hypothesis, written down in full."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from contactsense.isolation.link_hypotheses import PRIOR_STD, SensorModel, empty_hypotheses, isolate

JOINTS = 6
LINKS = 8  # seven of the arm and a tool beyond the wrist sensor
FORCE, MOMENT, TORQUE = 0.7, 0.2, 0.9
WRIST = (0.4, 0.05)
VARIANCE = np.full(JOINTS, TORQUE**2)


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
    }


def _sensors() -> SensorModel:
    covariance = np.diag([FORCE**2] * 3 + [MOMENT**2] * 3)
    return SensorModel(
        depth=np.minimum(np.arange(LINKS), JOINTS),
        beyond_wrist=np.arange(LINKS) > JOINTS,
        base_covariance=covariance,
        base_information=np.linalg.inv(covariance),
        torque_variance=VARIANCE,
        wrist_variance=np.array(WRIST) ** 2,
    )


def _dense(case, link, has_base, has_torque, has_wrist):  # type: ignore[no-untyped-def]
    """Fused wrench, covariance, energy and log evidence from the joint Gaussian of everything but the
    base."""
    rows, values, variances = [], [], []
    if has_torque:
        for j in range(JOINTS):
            rows.append(case["screw"][j] if j < min(link, JOINTS) else np.zeros(6))
            values.append(case["torque"][j])
            variances.append(TORQUE**2)
    if has_wrist:
        o = case["origin"]
        cross = np.array([[0, -o[2], o[1]], [o[2], 0, -o[0]], [-o[1], o[0], 0]])
        to_wrist = np.block([[np.eye(3), np.zeros((3, 3))], [-cross, np.eye(3)]])
        rows += list(to_wrist if link > JOINTS else np.zeros((6, 6)))
        values += list(to_wrist @ case["wrist"])
        variances += [WRIST[0] ** 2] * 3 + [WRIST[1] ** 2] * 3
    mean = case["base"] if has_base else np.zeros(6)
    prior = _sensors().base_covariance if has_base else PRIOR_STD**2 * np.eye(6)
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
        multivariate_normal(A @ mean, S).logpdf(y),
    )


@pytest.mark.parametrize("has_base", [True, False])
@pytest.mark.parametrize("has_torque", [True, False])
@pytest.mark.parametrize("has_wrist", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_every_subset_of_sensors_equals_the_dense_gaussian(
    has_base: bool, has_torque: bool, has_wrist: bool, seed: int
) -> None:
    case, out = _case(seed), empty_hypotheses(LINKS)
    isolate(
        _sensors(), case["screw"], case["base"], has_base, case["torque"], case["torque"], VARIANCE,
        has_torque, case["wrist"], case["wrist"], has_wrist, case["origin"], 1.0, out,
    )  # fmt: skip
    for link in range(LINKS):
        wrench, covariance, energy, evidence = _dense(case, link, has_base, has_torque, has_wrist)
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
    case, scaled, direct = _case(9), empty_hypotheses(LINKS), empty_hypotheses(LINKS)
    torque, wrist = case["torque"], case["wrist"]
    start = (case["screw"], case["base"], True, torque, torque, VARIANCE)
    rest = (True, wrist, wrist, True, case["origin"])
    isolate(_sensors(), *start, *rest, 0.25, scaled)
    s = _sensors()
    quarter = s._replace(
        base_covariance=s.base_covariance / 4,
        base_information=s.base_information * 4,
        wrist_variance=s.wrist_variance / 4,
    )
    isolate(quarter, *start, *rest, 1.0, direct)
    for a, b in zip(scaled, direct, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_the_torques_decide_for_the_touched_link_where_they_can() -> None:
    """A contact wrench on link k leaves the joints beyond k still: exactly known torques tell k at once."""
    case, out = _case(5), empty_hypotheses(LINKS)
    w = case["base"]
    for link in range(JOINTS + 1):
        torque = np.where(np.arange(JOINTS) < link, case["screw"] @ w, 0.0)
        isolate(
            _sensors(),
            case["screw"],
            w,
            True,
            torque,
            torque,
            VARIANCE * 1e-6,
            True,
            w,
            w,
            False,
            case["origin"],
            1e-6,
            out,
        )
        assert int(np.argmax(out.log_evidence[: JOINTS + 1])) == link
