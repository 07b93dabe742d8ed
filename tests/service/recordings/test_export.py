"""What is written in another format is read back the same."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import Contact, Scene, WrenchSensor
from contactsense.service.recordings import Recording, RecordingError, read
from contactsense.service.recordings.export import export
from contactsense.service.recordings.ros.ros_messages import METRES_PER_NEWTON, scene_update

N = 40
SCENE = Scene(robot="ur5e")


def recording() -> Recording:
    chance = np.random.default_rng(3)
    q, qd, torque, wrench = (chance.standard_normal((N, k)) for k in (6, 6, 6, 6))
    return Recording("made", 5.0 + 0.01 * np.arange(N), q, qd, torque, wrench, None, np.arange(N))


@pytest.mark.parametrize("name", ["a.parquet", "a.csv", "a.mcap", "A.Parquet", "A.CSV", "A.MCAP"])
def test_there_and_back(tmp_path: Path, name: str) -> None:
    if name.lower().endswith(".mcap"):
        pytest.importorskip("mcap_ros2")
        pytest.importorskip("rosbags")
    whole = recording()
    export(whole, tmp_path / name)
    found = read(tmp_path / name, SCENE)
    np.testing.assert_allclose(found.t, whole.t, atol=1e-8)
    np.testing.assert_allclose(found.q, whole.q)
    np.testing.assert_allclose(found.joint_torque, whole.joint_torque)
    np.testing.assert_allclose(found.base_wrench, whole.base_wrench, atol=1e-9)


@pytest.mark.parametrize("name", ["a.parquet", "a.csv", "a.mcap"])
def test_what_a_recording_lacks_is_not_written(tmp_path: Path, name: str) -> None:
    """Torques in all rows, wrenches in some."""
    if name.endswith(".mcap"):
        pytest.importorskip("mcap_ros2")
        pytest.importorskip("rosbags")
    whole = replace(recording(), joint_torque=None)
    assert whole.base_wrench is not None
    whole.base_wrench[10:30] = np.nan
    export(whole, tmp_path / name)
    found = read(tmp_path / name, SCENE)
    assert found.joint_torque is None
    np.testing.assert_allclose(found.base_wrench, whole.base_wrench, atol=1e-9)


def test_wrenches_in_a_bag_name_their_frame(tmp_path: Path) -> None:
    """Base axes for other programs; the sensor's own for the scene that turns them again."""
    pytest.importorskip("mcap_ros2")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    turned = Scene(robot="ur5e", base_wrench=WrenchSensor(rpy=(0.1, 0.2, 0.3), sign="sensor_on_arm"))
    for scene, frame in ((None, "base"), (turned, "base_wrench")):
        export(recording(), tmp_path / "a.mcap", scene=scene)
        with (tmp_path / "a.mcap").open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            messages = reader.iter_decoded_messages(topics=["/base_wrench"])
            assert {message.header.frame_id for _, _, _, message in messages} == {frame}
    pytest.importorskip("rosbags")
    np.testing.assert_allclose(read(tmp_path / "a.mcap", turned).base_wrench, recording().base_wrench)


def test_a_bag_without_the_topic_lists_what_it_has(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    pytest.importorskip("rosbags")
    export(recording(), tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match=r"on /joints, found /base_wrench \(geometry_msgs"):
        read(tmp_path / "a.mcap", SCENE, "joint_states=/joints")
    with pytest.raises(RecordingError, match=r"WrenchStamped messages on /ft, found /base_wrench \(geometry"):
        read(tmp_path / "a.mcap", SCENE, "base_wrench_topic=/ft")
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:200])
    with pytest.raises(RecordingError, match=r"b\.mcap"):
        read(tmp_path / "b.mcap", SCENE)


def contact(force: tuple[float, float, float]) -> Contact:
    point = np.array([0.1, 0.2, 0.3])
    return Contact(
        "forearm", 3, 0, 0.9, point, point, np.array([0.0, 0.0, 1.0]), np.array(force), 0.0, np.eye(3)
    )


@pytest.mark.parametrize("force", [(0, 0, -20), (10, 5, 1), (-7, 0, 0), (0, 0, 0)])
def test_an_arrow_ends_at_the_contact(force: tuple[float, float, float]) -> None:
    (entity,) = scene_update(1.5, [contact(force)])["entities"]
    (arrow,) = entity["arrows"]
    x, y, z, w = (arrow["pose"]["orientation"][k] for k in "xyzw")
    along = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    length = arrow["shaft_length"] + arrow["head_length"]
    assert length == pytest.approx(METRES_PER_NEWTON * np.linalg.norm(force))
    tail = np.array([arrow["pose"]["position"][k] for k in "xyz"])
    np.testing.assert_allclose(tail + length * along, [0.1, 0.2, 0.3], atol=1e-12)


def test_contacts_are_written_as_arrows(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    export(recording(), tmp_path / "a.mcap", [(5.1, [contact((0, 0, -20))]), (5.2, [])])
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [message for *_, message in reader.iter_decoded_messages(topics=["/contacts"])]
    assert len(found[0].entities[0].arrows) == 1
    assert len(found[1].deletions) == 1


def test_an_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"\.parquet, \.csv or \.mcap"):
        export(recording(), tmp_path / "a.xlsx")


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(struct.pack("8I", *range(8)))
    with pytest.raises(RecordingError, match=r"a\.parquet"):
        read(tmp_path / "a.parquet", SCENE)
