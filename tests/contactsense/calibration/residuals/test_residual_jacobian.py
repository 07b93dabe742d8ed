"""Derivatives of a recording's residuals by the parameters of a calibration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense.benchmarks.calibration.coverage import CENTER, draw
from contactsense.benchmarks.calibration.link_sensor_draws import WRIST
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Group, apply_step, entries
from contactsense.calibration.residuals.equations import linearize_all
from contactsense.calibration.residuals.link_residuals import link_residuals
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
    ("group", "signal", "joints"),
    [("gain", "torque", True), ("delay", "reading", False), ("turn", "reading", False)],
)
def test_noise_of_a_signal_is_not_in_the_derivatives_by_its_parameters(
    recorded: tuple[CalibrationModel, FreeMotion], group: Group, signal: str, joints: bool
) -> None:
    """In a regressor it would bias torque constants towards zero, and seem to exclude any delay and, of an
    arm at rest, any turn."""
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


@pytest.mark.parametrize("field", ["base_wrench", WRIST])
def test_readings_without_noise_turn_with_the_sensor_by_the_derivative(field: str) -> None:
    """About each axis, from an orientation that differs from the scene's."""
    truth = right_setup("ur5e", 1, Settings(), WRIST).scene
    quiet, turn = {}, np.array([0.3, -0.2, 0.5])
    for name in ("base_wrench", WRIST):
        sensor = getattr(truth, name)
        quiet[name] = sensor.model_copy(update={"force_noise": 1e-9, "moment_noise": 1e-9, "delay": 0.0})
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.3), 2, 6.0)
    recording = simulate(truth.model_copy(update=quiet), motion, 13, 250.0)
    before = Rotation.from_rotvec(-turn) * Rotation.from_matrix(quiet[field].rotation)
    quiet[field] = quiet[field].model_copy(update={"rpy": tuple(before.as_euler("xyz").tolist())})
    group: Group = "turn" if field == "base_wrench" else "link_turn"
    arm = CalibrationModel.of(truth.model_copy(update=quiet))
    arm = arm.with_values(**{group: turn if group == "turn" else turn[None]})
    selected, kept = entries(arm, (group,)), samples_of_rows(recording, BANDWIDTH)

    def found(x: CalibrationModel) -> np.ndarray:
        if field == "base_wrench":
            return residuals(x, recording, BANDWIDTH, about=arm)[kept, 6:]
        return link_residuals(x, recording, field, BANDWIDTH, seen_by=arm)[kept]

    first = 6 if field == "base_wrench" else 12
    rows = {row.channel - first: row for row in linearize_all(arm, recording, selected, BANDWIDTH)}
    for i, entry in enumerate(selected):
        change = (found(apply_step(arm, [entry], np.array([1e-6]))) - found(arm)) / 1e-6
        slope = np.column_stack([rows[c].slope[:, rows[c].columns == i].sum(axis=1) for c in range(6)])
        # A sensor within the arm turns within the time constant of the filter, which is one in base axes.
        share = 0.001 if field == "base_wrench" else 0.03
        np.testing.assert_allclose(slope, change, atol=share * np.abs(change).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "group",
    ["links", "payload", "bias", "coulomb", "viscous", "rotor", "shift", "tilt", "wrench_bias"],
)
def test_a_small_step_changes_the_residuals_by_the_derivative(
    recorded: tuple[CalibrationModel, FreeMotion], group: Group
) -> None:
    """Not by the delay: the interpolation between samples has kinks. Nor by the orientation of a sensor."""
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
