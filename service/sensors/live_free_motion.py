"""Samples of a live arm in the form that calibration and the check of a scene need."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactsense.calibration import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP
from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.sensor_delays import without_delays
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.link_values import by_field
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.types import Sample

_MIN_SHARE = 0.5
"""A sensor counts as present if at least this share of the samples has its value."""
_PATIENCE = 10.0
"""Time without any sample before reading is given up [s]."""


def read_live_motion(
    scene: Scene, settings: SourceSettings, seconds: float, progress: Callable[[float], None]
) -> FreeMotion:
    """Read a live arm for some time.

    Readings are taken as they are: neither shifted by the delay that the scene states nor left out because
    they contradict it.

    Args:
        scene: Defines which signals are used, and their meaning.
        settings: Sources of the signals.
        seconds: Time to read [s]; of a longer gap between two samples, `GAP` counts.
        progress: Called with the time read so far [s].

    Raises:
        SensorError: No samples arrive, or fewer than three; or the sources lack a signal of the scene.
    """
    scene = without_delays(scene)
    samples: list[Sample] = []
    with LiveSource(scene, replace(settings, constant_readings=True)) as live:
        last = time.monotonic()
        read = outages = 0.0
        while not samples or read < seconds:
            new = live.poll(0.1)
            for sample in new:
                if samples and sample.t < samples[-1].t:  # the controller was restarted: begin anew
                    samples.clear()
                    outages = 0.0
                if samples:
                    outages += max(0.0, sample.t - samples[-1].t - GAP)
                samples.append(sample)
            if new:
                last = time.monotonic()
                read = samples[-1].t - samples[0].t - outages
                progress(read)
            elif time.monotonic() - last > _PATIENCE:
                trouble = live.health.trouble or "no samples arrive"
                raise SensorError(f"{settings.robot_host}: no samples for {_PATIENCE:.0f} s: {trouble}")
    return _free_motion(scene, samples, settings.robot_host)


def _free_motion(scene: Scene, samples: list[Sample], name: str) -> FreeMotion:
    torque = _usual([sample.joint_torque for sample in samples])
    wrench = _usual([sample.base_wrench for sample in samples])
    every = [by_field(sample.wrist_wrench, sample.link_wrenches) for sample in samples]
    found = {field: _usual([values.get(field) for values in every]) for field in scene.link_sensors}
    links = {field: values for field, values in found.items() if values is not None}
    needed = [values for values in (torque, wrench, *links.values()) if values is not None]
    kept, t = [], -np.inf
    for i, sample in enumerate(samples):
        if sample.t > t and all(values[i] is not None for values in needed):
            kept.append(i)
            t = sample.t
    if len(kept) < 3:
        raise SensorError(f"{name}: expected at least 3 samples with all sensors, got {len(kept)}")
    q = np.array([samples[i].q for i in kept])
    reading = None
    if wrench is not None and scene.base_wrench is not None:
        reading = WrenchMap.of(scene.base_wrench).reading(np.array([wrench[i] for i in kept]))
    return FreeMotion(
        np.array([samples[i].t for i in kept]),
        q,
        np.array([samples[i].qd for i in kept]),
        None if torque is None else np.array([torque[i] for i in kept]),
        reading,
        name,
        link_readings={
            field: LinkSensorFrame(scene, field).readings(q, np.array([values[i] for i in kept]))
            for field, values in links.items()
        },
    )


def _usual(values: list[np.ndarray | None]) -> list[np.ndarray | None] | None:
    """The values, or None where most samples have none."""
    there = sum(value is not None for value in values)
    return values if there >= _MIN_SHARE * len(values) else None
