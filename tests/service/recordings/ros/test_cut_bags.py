"""MCAP files and rosbag2 folders, whole and cut short."""

import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.analysis.fleet.segments import find_recordings
from contactsense.service.recordings import Recording, RecordingError, read
from contactsense.service.recordings.export import export
from contactsense.service.recordings.ros.cut_bags import raw_messages, storage_files

pytest.importorskip("mcap_ros2")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

N = 12_000
SCENE = Scene(robot="ur5e")


@cache
def _recording(rows: int = N) -> Recording:
    chance = np.random.default_rng(3)
    qd, torque, wrench = (chance.standard_normal((rows, 6)) for _ in range(3))
    q = np.cumsum(0.002 * qd, axis=0)
    return Recording("made", 5.0 + 0.002 * np.arange(rows), q, qd, torque, wrench, None, np.arange(rows))


@pytest.fixture(scope="module")
def rosbag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a rosbag2 folder with an SQLite database; whoever changes it takes a copy."""
    folder = tmp_path_factory.mktemp("rosbag") / "bag"
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds: Any = store.types
    joints, wrenches = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
    whole = _recording()
    assert whole.joint_torque is not None
    assert whole.base_wrench is not None
    with rosbag2.Writer(folder, version=9) as writer:
        joint = writer.add_connection("/joint_states", joints, typestore=store)
        base = writer.add_connection("/base_wrench", wrenches, typestore=store)
        for i, t in enumerate(whole.t):
            stamp = round(1e9 * t)
            time = kinds["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            header = kinds["std_msgs/msg/Header"](time, "")
            names = [f"joint_{k}" for k in range(6)]
            state = kinds[joints](header, names, whole.q[i], whole.qd[i], whole.joint_torque[i])
            writer.write(joint, stamp, store.serialize_cdr(state, joints))
            force, moment = (
                kinds["geometry_msgs/msg/Vector3"](*map(float, part))
                for part in np.split(whole.base_wrench[i], 2)
            )
            wrench = kinds[wrenches](header, kinds["geometry_msgs/msg/Wrench"](force, moment))
            writer.write(base, stamp, store.serialize_cdr(wrench, wrenches))
    return folder


def _cut(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: 2 * len(data) // 3])


def _check_rest(found: Recording, least: float) -> None:
    """At least that share of the rows, with the right content, and a word about the end."""
    whole = _recording()
    count = len(found)
    assert least * N < count < 0.7 * N
    np.testing.assert_allclose(found.t, whole.t[:count], atol=1e-8)
    np.testing.assert_allclose(found.q, whole.q[:count])
    assert found.problems[-1].kind == "cut_short"
    assert found.problems[-1].row_from == count


@pytest.mark.slow
def test_a_rosbag2_folder_is_read(rosbag: Path) -> None:
    found = read(rosbag, SCENE)
    whole = _recording()
    np.testing.assert_allclose(found.t, whole.t, atol=1e-8)
    np.testing.assert_allclose(found.joint_torque, whole.joint_torque)
    np.testing.assert_allclose(found.base_wrench, whole.base_wrench)
    assert not found.problems


@pytest.mark.slow
def test_an_mcap_file_that_is_cut_short_is_used_up_to_there(tmp_path: Path) -> None:
    export(_recording(), tmp_path / "a.mcap")
    _cut(tmp_path / "a.mcap")
    # Of a packed chunk of 1 MB that is cut nothing is left.
    _check_rest(read(tmp_path / "a.mcap", SCENE), 0.25)


@pytest.mark.parametrize("metadata", [True, False])
def test_a_rosbag2_folder_that_is_cut_short_is_used_up_to_there(
    tmp_path: Path, rosbag: Path, metadata: bool
) -> None:
    bag = copytree(rosbag, tmp_path / "bag")
    _cut(bag / "bag.db3")
    if not metadata:
        (bag / "metadata.yaml").unlink()
    found = read(bag, SCENE)
    _check_rest(found, 0.6)
    assert found.problems[-1].message.endswith("; bag.db3: database disk image is malformed")


def test_a_damaged_topic_number_is_told(tmp_path: Path, rosbag: Path) -> None:
    bag = copytree(rosbag, tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute("UPDATE messages SET topic_id = 9 WHERE rowid = ?", (N,))
        database.commit()
    found = read(bag, SCENE)
    _check_rest(found, 0.4)
    assert "a message of topic 9, which is not in the file" in found.problems[-1].message


def test_a_message_of_a_channel_that_is_not_in_the_file_ends_it(tmp_path: Path) -> None:
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, use_chunking=False)
        writer.start()
        schema = writer.register_schema("kind", "ros2msg", b"")
        channel = writer.register_channel("/joint_states", "cdr", schema)
        writer.add_message(channel, 0, b"first", 0)
        writer.finish()
    messages = raw_messages(path)
    assert next(messages) == ("/joint_states", "kind", b"first")
    data = path.read_bytes()
    at = data.index(b"first") - 22  # after channel (2), sequence (4), log and publish time (8 + 8)
    assert data[at : at + 2] == channel.to_bytes(2, "little")
    path.write_bytes(data[:at] + (9).to_bytes(2, "little") + data[at + 2 :])
    with pytest.raises(ValueError, match="a message of channel 9, which is not in the file"):
        next(raw_messages(path))


@pytest.mark.parametrize("name", ["50%25", "Zelle 1?", "bag #2", "Süd"])
def test_the_name_of_a_folder_does_not_matter(tmp_path: Path, rosbag: Path, name: str) -> None:
    """SQLite gives some characters of an address a meaning: it made an empty file of another name."""
    bag = copytree(rosbag, tmp_path / name)
    _cut(bag / "bag.db3")
    _check_rest(read(bag, SCENE), 0.6)
    assert list(tmp_path.iterdir()) == [bag]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["50%25", "Zelle 1?", "bag #2", "Süd"])
def test_a_whole_bag_is_not_said_to_be_incomplete_for_its_name(
    tmp_path: Path, rosbag: Path, name: str
) -> None:
    found = read(copytree(rosbag, tmp_path / name), SCENE)
    assert len(found) == N
    assert not found.problems


def test_the_files_of_a_bag_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """Those of a bag that is cut short are read one after the other."""
    names = ["2026-11-30_0.mcap", "2026-11-30_2.mcap", "2026-11-30_10.mcap"]
    for name in [*names, "metadata.yaml"]:
        (tmp_path / name).touch()
    assert [file.name for file in storage_files(tmp_path)] == names


def test_a_folder_without_metadata_is_read_whole_and_said_to_be_incomplete(
    tmp_path: Path, rosbag: Path
) -> None:
    bag = copytree(rosbag, tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    found = read(bag, SCENE)
    assert len(found) == N
    assert "metadata.yaml is missing" in found.problems[-1].message


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"\xff" * 200], ids=["none", "no lengths"])
def test_messages_that_are_damaged_are_left_out_and_told(
    tmp_path: Path, rosbag: Path, content: bytes
) -> None:
    bag = copytree(rosbag, tmp_path / "bag")
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute("UPDATE messages SET data = ? WHERE topic_id = 1 AND id = 21", (content,))
        database.commit()
    found = read(bag, SCENE)
    np.testing.assert_array_equal(found.q, np.delete(_recording().q, 10, axis=0))
    assert "bag.db3: 1 of its messages cannot be read" in found.problems[-1].message


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("UPDATE messages SET data = x'ff' WHERE topic_id = 1", f".* {N} of its messages cannot be read"),
        ("DELETE FROM messages WHERE topic_id = 1", ""),
    ],
)
def test_joint_states_of_which_none_can_be_read_are_told(
    tmp_path: Path, rosbag: Path, change: str, why: str
) -> None:
    """Their topic is there: it is not another one that is meant."""
    bag = copytree(rosbag, tmp_path / "bag")
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute(change)
        database.commit()
    with pytest.raises(RecordingError, match=f"on /joint_states, found none that can be read{why}$"):
        read(bag, SCENE)


def test_a_damaged_chunk_of_an_mcap_file_is_not_used(tmp_path: Path) -> None:
    """Values that the damage has changed would be taken for measured ones."""
    path = tmp_path / "a.mcap"
    export(_recording(6000), path)
    data = bytearray(path.read_bytes())
    middle = slice(len(data) // 2, len(data) // 2 + 8)
    data[middle] = bytes(255 - byte for byte in data[middle])
    path.write_bytes(data)
    found = read(path, SCENE)
    assert 0 < len(found) < 6000
    np.testing.assert_array_equal(found.q, _recording().q[: len(found)])
    assert found.problems[-1].kind == "cut_short"


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.db3"):
        (tmp_path / name).write_bytes(b"no bag at all")
        with pytest.raises(RecordingError, match=f"{name}: cannot read the recording"):
            read(tmp_path / name, SCENE)


def test_bags_of_a_dataset_are_found_once(tmp_path: Path, rosbag: Path) -> None:
    here = tmp_path / "robot=a" / "date=2026-01-01"
    here.mkdir(parents=True)
    export(_recording(10), here / "one.mcap")
    bag = copytree(rosbag, here / "two")
    export(_recording(10), here / "three.csv")
    found = find_recordings((tmp_path,))
    assert [file.path.name for file in found] == ["one.mcap", "three.csv", "two"]
    assert all(file.robot == "a" for file in found)
    key = found[2].key
    _cut(bag / "bag.db3")
    assert found[2].key != key
