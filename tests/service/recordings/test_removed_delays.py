"""Readings that a service writes have been freed of the delays of the sensors: reading leaves them."""

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Scene
from contactsense.scene import LinkWrenchSensor, WrenchSensor
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.service.recordings import RecordingError, read
from contactsense.service.recordings.free_motion import read_free_motion
from contactsense.service.recordings.metadata import metadata
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from tests.service.recordings.recorded_tables import columns
from tests.service.recordings.samples import SCENE, estimate, sample


def test_delays_are_taken_off_once(tmp_path: Path) -> None:
    """Samples have been freed of them; calibration takes the readings as they came."""
    elbow = LinkWrenchSensor(name="elbow", link="forearm", delay=0.05)
    scene = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=0.02), link_wrenches=[elbow])
    listener = ClipListener(scene, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
    listener.command({"type": "record", "on": True})
    frame = LinkSensorFrame(scene, "link_wrenches.elbow")
    for i in range(500):
        felt = 0.002 * i + np.arange(6)
        made = replace(sample(i), t=0.002 * i, base_wrench=felt)
        listener.receive(replace(made, link_wrenches={"elbow": frame.wrench(made.q, felt)}), estimate(i))
    listener.command({"type": "clip", "number": 1, "before": 100.0, "after": 0.0001})
    time.sleep(0.01)
    listener.tick(time.monotonic())
    listener.close()
    inner = slice(100, 400)
    for path in tmp_path.glob("*.parquet"):
        found = read(path)
        np.testing.assert_allclose(found.base_wrench[inner, 2], found.t[inner] + 2.0, atol=1e-9)
        (free,), _ = read_free_motion(path, scene)
        np.testing.assert_allclose(free.reading[inner, 2], free.t[inner] - 0.02 + 2.0, atol=1e-9)
        readings = free.link_readings["link_wrenches.elbow"]
        np.testing.assert_allclose(readings[inner, 2], free.t[inner] - 0.05 + 2.0, atol=1e-9)
        # Another scene may state another delay.
        later = read(path, scene.model_copy(update={"base_wrench": WrenchSensor(delay=0.03)}))
        np.testing.assert_allclose(later.base_wrench[inner, 2], later.t[inner] + 0.01 + 2.0, atol=1e-9)
    assert len(list(tmp_path.glob("*.parquet"))) == 2


def test_files_with_other_delays_are_not_read_as_one(tmp_path: Path) -> None:
    for delay in (0.0, 0.02):
        scene = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=delay))
        listener = ClipListener(scene, RecordingSettings(folder=tmp_path, minutes=0.1), 500.0)
        for i in range(10):
            listener.receive(sample(i), estimate(i))
        listener.command({"type": "clip", "number": int(100 * delay), "before": 100.0, "after": 0.0001})
        time.sleep(0.01)
        listener.tick(time.monotonic())
        listener.close()
    with pytest.raises(RecordingError, match=r"clip-.*-000000\.parquet and clip-.*-000002\.parquet.*delays"):
        read(tmp_path, SCENE)


@pytest.mark.parametrize("entry", ["{", "[0.02]", '{"base_wrench": "late"}', '{"base_wrench": 1e999}'])
@pytest.mark.parametrize("folder", [True, False])
def test_delays_that_are_damaged_are_told(tmp_path: Path, entry: str, folder: bool) -> None:
    path = tmp_path / "a.parquet"
    meta = metadata(SCENE, table="samples", removed_delays=entry)
    pa_parquet.write_table(pa.table(columns(), metadata=meta), path)
    told = r"a\.parquet: contactsense\.removed_delays in its metadata: expected the delays .*, got "
    with pytest.raises(RecordingError, match=told + re.escape(repr(entry))):
        read(tmp_path if folder else path, SCENE)
