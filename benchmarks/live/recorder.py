"""`python -m benchmarks.live.recorder`: losses, memory use and output size of `contactsense record`.

The mock arm is recorded live for some time at 500 Hz. With `--hours`, only the writer runs, as fast as it
can, to show the size of a long recording and whether memory use grows.
"""

import json
import resource
import tempfile
import time
from pathlib import Path

import click
import numpy as np

from contactsense.service.api.sample_source import reader_settings
from contactsense.service.api.scene_file import load_scene
from contactsense.service.api.settings import Settings
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.recordings.writing.segment_writer import Rotation, SegmentWriter
from contactsense.service.sensors.live_source import LiveSource

_RATE = 500.0
_SCRIPT = {
    "robot": "ur5e",
    "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
    "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 30.0},
}


def live(seconds: float, rotation: Rotation, folder: Path) -> dict[str, float]:
    """Record the mock arm; returns samples, losses, megabytes."""
    motion = simulate(Script.model_validate(_SCRIPT))
    chosen = MockSettings(rtde_port=0, netft_port=0, http_port=0, loop=True)
    with MockServers(motion, chosen) as servers:
        settings = Settings(
            robot_host=chosen.host,
            robot_port=servers.rtde.port,
            ft_host=chosen.host,
            ft_port=servers.netft.port,
            ft_http_port=servers.netft.http_port,
        )
        scene = load_scene(settings)
        reader = reader_settings(settings, scene)
        assert reader is not None
        source = LiveSource(scene, reader)
        recorder = Recorder(folder, scene, rotation, rate=_RATE)
        source.observer = recorder
        begin, half = time.monotonic(), 0
        while (spent := time.monotonic() - begin) < seconds:
            source.poll(0.1)
            if not half and spent > 0.5 * seconds:
                half = _peak_memory()
        health = source.health
        source.close()
    files = recorder.close()
    return {
        "seconds": seconds,
        "samples": recorder.rows,
        "readings": recorder.readings,
        "lost_samples": health.robot.lost,
        "lost_readings": 0 if health.wrench is None else health.wrench.lost,
        "megabytes": sum(path.stat().st_size for path in files) / 1e6,
        "memory_growth_second_half_mb": (_peak_memory() - half) / 1e3,
    }


def _peak_memory() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def writer(hours: float, folder: Path) -> dict[str, float]:
    """Write that many hours of random samples as fast as possible; returns memory growth, size, speed."""
    rows = int(hours * 3600.0 * _RATE)
    columns = [f"value_{i}" for i in range(33)]
    made = SegmentWriter(folder, "samples", columns, {}, Rotation(megabytes=64.0), rate=_RATE)
    chance = np.random.default_rng(1).standard_normal((5000, len(columns)))
    begin, half = time.monotonic(), 0
    for i in range(rows):
        made.add(chance[i % len(chance)])
        if i == rows // 2:
            half = _peak_memory()
    files = made.close()
    return {
        "hours": hours,
        "samples": rows,
        "megabytes": sum(path.stat().st_size for path in files) / 1e6,
        "times_real_time": hours * 3600.0 / (time.monotonic() - begin),
        "memory_growth_second_half_mb": (_peak_memory() - half) / 1e3,
    }


@click.command()
@click.option("--seconds", default=60.0, show_default=True, help="Length of the live recording.")
@click.option(
    "--rotate-seconds",
    default=600.0,
    show_default=True,
    help="Longest file of the live recording.",
)
@click.option("--hours", default=1.0, show_default=True, help="Length of the recording of the writer alone.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def main(seconds: float, rotate_seconds: float, hours: float, as_json: bool) -> None:
    """Record the mock arm live, then write a long recording faster than real time."""
    with tempfile.TemporaryDirectory() as folder:
        found = {
            "live": live(seconds, Rotation(rotate_seconds), Path(folder) / "live"),
            "writer": writer(hours, Path(folder) / "long"),
        }
    if as_json:
        click.echo(json.dumps(found, indent=1))
        return
    for name, numbers in found.items():
        click.echo(f"{name}: " + ", ".join(f"{key} {value:.6g}" for key, value in numbers.items()))


if __name__ == "__main__":
    main()
