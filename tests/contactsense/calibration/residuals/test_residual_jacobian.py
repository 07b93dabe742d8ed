"""Derivatives of a recording's residuals by the parameters of a calibration."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.coverage import CENTER, draw
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Group, apply_step, entries
from contactsense.calibration.residuals.recording_residuals import residuals, samples_of_rows
from contactsense.calibration.residuals.residual_jacobian import linearize
from contactsense.calibration.residuals.smooth_velocities import with_smooth_velocities

BANDWIDTH = 10.0


@pytest.fixture(scope="module")
def recorded() -> tuple[CalibrationModel, FreeMotion]:
    truth, gain, start = draw(np.random.default_rng(11))
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.7), 8, 6.0)
    return CalibrationModel.of(start), simulate(truth, motion, 13, 125.0, gain)


@pytest.mark.parametrize(
    ("group", "signal", "joints"), [("gain", "torque", True), ("delay", "reading", False)]
)
def test_noise_of_a_signal_is_not_in_the_derivatives_by_its_parameters(
    recorded: tuple[CalibrationModel, FreeMotion], group: Group, signal: str, joints: bool
) -> None:
    """In a regressor it would bias torque constants towards zero, and seem to exclude any delay."""
    arm, recording = recorded
    measured = getattr(recording, signal)
    noise = 30.0 * np.random.default_rng(0).standard_normal(measured.shape)
    noisy = replace(recording, **{signal: measured + noise})
    selected = entries(arm, (group,))
    clean, disturbed = (linearize(arm, x, selected, BANDWIDTH) for x in (recording, noisy))
    for one, other in zip(clean, disturbed, strict=True):
        concerned = (one.channel < 6) == joints
        assert (len(one.columns) > 0) == concerned
        np.testing.assert_allclose(one.slope, other.slope, atol=1e-9 * np.abs(one.slope).max(initial=0.0))
        if concerned:
            assert np.std(one.residual - other.residual) > 1.0


def test_readings_without_noise_change_with_the_delay_by_the_derivative() -> None:
    """Except where the observer starts, at first and after a gap."""
    truth, gain, _ = draw(np.random.default_rng(11))
    assert truth.base_wrench is not None
    quiet = truth.base_wrench.model_copy(update={"force_noise": 1e-9, "moment_noise": 1e-9})
    arm = CalibrationModel.of(truth.model_copy(update={"base_wrench": quiet}))
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.2), 8, 6.0)
    recording = simulate(arm.scene, motion, 13, 500.0, gain).part(np.r_[:1500, 1600:3000])
    selected = entries(arm, ("delay",))
    step = np.array([0.01])
    changed = apply_step(arm, list(selected), step)
    change = (residuals(changed, recording, BANDWIDTH) - residuals(arm, recording, BANDWIDTH)) / step
    settled = np.zeros(len(recording.t), dtype=bool)
    # Behind the last samples there are no later readings.
    settled[np.r_[125:1490, 1625:2890]] = True
    kept = samples_of_rows(recording, BANDWIDTH)
    settled, change = settled[kept], change[kept]
    for row in linearize(arm, recording, selected, BANDWIDTH):
        if row.channel >= 6:
            expected = change[settled, row.channel]
            np.testing.assert_allclose(row.slope[settled, 0], expected, atol=0.1 * np.abs(expected).max())
            assert np.abs(row.slope).max() < 1.1 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "group",
    ["links", "payload", "bias", "coulomb", "viscous", "rotor", "turn", "shift", "tilt", "wrench_bias"],
)
def test_a_small_step_changes_the_residuals_by_the_derivative(
    recorded: tuple[CalibrationModel, FreeMotion], group: Group
) -> None:
    """Not by the delay: the interpolation between samples has kinks."""
    arm, recording = recorded
    selected = entries(arm, (group,))
    step = 1e-3 * np.array([entry.prior_std for entry in selected])
    # Masses have those of a motion without the noise of its velocities in the base sensor.
    part = with_smooth_velocities(recording) if group in ("links", "payload") else recording
    before, after = (
        np.hstack(
            [
                residuals(x, motion, BANDWIDTH, about=arm)[:, own]
                for motion, own in ((recording, slice(6)), (part, slice(6, 12)))
            ]
        )
        for x in (arm, apply_step(arm, list(selected), step))
    )
    change = after - before
    for row in linearize(arm, recording, selected, BANDWIDTH):
        expected = change[-len(row.residual) :, row.channel]
        np.testing.assert_allclose(row.slope @ step[row.columns], expected, atol=1e-3 * np.abs(change).max())
    assert np.abs(change).max() > 0.0


def test_the_rows_of_a_fit_do_not_depend_on_where_the_clock_begins(
    recorded: tuple[CalibrationModel, FreeMotion],
) -> None:
    """At 250 Hz a row is due after two and a half samples, which the rounding of large times decided."""
    _, recording = recorded
    at_250_hz = replace(recording, t=0.5 * recording.t)
    of_epoch = replace(at_250_hz, t=at_250_hz.t + 1.7e9 + 0.1)
    assert samples_of_rows(at_250_hz, BANDWIDTH).step == samples_of_rows(of_epoch, BANDWIDTH).step
