import json
import math
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense import Scene
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.sample_message import (
    MAX_SAMPLE,
    MAX_SCENE,
    MessageError,
    SampleDecoder,
    decode,
    encode,
)
from contactsense.service.controllers.scene_message import make_scene

DECODER = SampleDecoder(Scene(robot="ur5e"))
GOOD: dict[str, Any] = {"t": 1, "q": [0.5] * 6, "qd": [0] * 6, "base_wrench": [1.5] * 6, "joint_torque": None}
finite = st.floats(allow_nan=False, allow_infinity=False)
anything = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**62), 2**62) | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=7)
        | st.dictionaries(st.sampled_from(["t", "q", "qd", "scene", "x"]), inner, max_size=5)
    ),
    max_leaves=20,
)


@pytest.mark.parametrize("binary", [False, True])
@given(t=finite, q=st.lists(finite, min_size=6, max_size=6))
def test_numbers_arrive_as_they_were_sent(binary: bool, t: float, q: list[float]) -> None:
    sample = DECODER.sample(decode(encode({**GOOD, "t": t, "q": q}, binary), binary))
    assert sample.t == t
    assert sample.q.tolist() == q
    assert sample.joint_torque is None
    assert sample.wrist_wrench is None
    np.testing.assert_array_equal(sample.base_wrench, [1.5] * 6)


@pytest.mark.parametrize(
    ("change", "field", "reason"),
    [
        ({"t": None}, "t", "got null"),
        ({"t": True}, "t", "got True"),
        ({"t": math.inf}, "t", "got inf"),
        ({"t": 2**60}, "t", "finite numbers"),
        ({"q": [0.0] * 5}, "q", "6 numbers, one per joint of ur5e, got 5"),
        ({"q": 0.0}, "q", "got 0.0"),
        ({"qd": [0.0] * 5 + ["x"]}, "qd", "got text"),
        ({"qd": [0.0] * 5 + [math.nan]}, "qd", "got nan"),
        ({"base_wrench": [0.0] * 7}, "base_wrench", "6 numbers, got 7"),
        ({"joint_torque": [[0.0]] * 6}, "joint_torque", "got a list"),
        ({"wrist_wrench": [0.0] * 6}, "wrist_wrench", "no such sensor"),
        ({"torque": [0.0] * 6}, "torque", "unknown field (known: "),
    ],
)
@pytest.mark.parametrize("binary", [False, True])
def test_errors_name_the_field(change: dict[str, Any], field: str, reason: str, binary: bool) -> None:
    content = {**GOOD, **change}
    message = msgpack.packb(content) if binary else json.dumps(content).encode()
    with pytest.raises(MessageError) as caught:
        DECODER.sample(decode(message, binary))
    assert caught.value.field == field
    assert reason in caught.value.reason


def test_a_number_of_thousands_of_digits_is_named() -> None:
    """Python reads none of more than 4300."""
    message = json.dumps(GOOD).replace("1", "-" + 5000 * "9", 1).encode()
    with pytest.raises(MessageError, match=r"^t: expected finite numbers, got -inf$"):
        DECODER.sample(decode(message, False))


def test_a_field_that_comes_twice_is_named() -> None:
    with pytest.raises(MessageError, match=r"^q: expected once, got twice$") as caught:
        decode(b'{"t": 0, "q": [], "q": [1]}', False)
    assert caught.value.field == "q"


def test_sensors_between_links_come_by_name() -> None:
    decoder = SampleDecoder(Scene(robot="ur5e", link_wrenches=[{"name": "elbow", "link": "forearm"}]))
    assert decoder.sample(GOOD).link_wrenches is None
    sample = decoder.sample({**GOOD, "link_wrenches": {"elbow": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]}})
    assert sample.link_wrenches is not None
    np.testing.assert_array_equal(sample.link_wrenches["elbow"], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert decoder.sample({**GOOD, "link_wrenches": {"elbow": None}}).link_wrenches == {}
    for links, field, reason in (
        ([0.0] * 6, "link_wrenches", "an object with a wrench for each name, got a list"),
        ({"forearm": [0.0] * 6}, "link_wrenches.forearm", "no such sensor"),
        ({"elbow": [0.0] * 5}, "link_wrenches.elbow", "6 numbers, got 5"),
    ):
        with pytest.raises(MessageError) as caught:
            decoder.sample({**GOOD, "link_wrenches": links})
        assert caught.value.field == field
        assert reason in caught.value.reason


@pytest.mark.parametrize("name", ["t", "q", "qd"])
def test_a_missing_field_is_named(name: str) -> None:
    with pytest.raises(MessageError, match=f"^{name}: expected a value"):
        DECODER.sample({key: value for key, value in GOOD.items() if key != name})


NO_JSON, NO_PACK = (f"expected one object in {name}: ." for name in ("JSON", "MessagePack"))


@pytest.mark.parametrize(
    ("message", "binary", "told"),
    [
        (b"", False, NO_JSON),
        (b"", True, NO_PACK),
        (b"[1]", False, "expected an object, got a list"),
        (b"\x93\x01\x02\x03", True, "expected an object, got a list"),
        (b"\xff\xfe", False, NO_JSON),
        (b"[" * 100_000, False, NO_JSON),
        (b"\x91" * 100_000, True, NO_PACK),
        pytest.param(b"9" * 5000, False, "expected an object, got inf", id="digits"),
        (b"{" + b" " * MAX_SCENE + b"}", False, f"expected at most {MAX_SCENE} bytes, got {MAX_SCENE + 2}"),
        (b"\xdf\xff\xff\xff\xff", True, NO_PACK),
        (b"\x81\xa1t\xd6\xff\x00\x00\x00\x00\x00", True, NO_PACK),
    ],
)
def test_what_is_no_message_is_refused(message: bytes, binary: bool, told: str) -> None:
    """Before its fields are looked at."""
    with pytest.raises(MessageError, match=f"^{told}"):
        decode(message, binary)


def test_a_long_sample_is_refused() -> None:
    with pytest.raises(MessageError, match=f"at most {MAX_SAMPLE} bytes"):
        DECODER.sample(GOOD, MAX_SAMPLE + 1)


@pytest.mark.slow
@given(content=anything)
def test_whatever_comes_is_a_sample_or_an_error(content: Any) -> None:
    for binary in (False, True):
        message = msgpack.packb(content) if binary else json.dumps(content).encode()
        try:
            DECODER.sample(decode(message, binary))
        except MessageError as error:
            encode({"field": error.field, "reason": error.reason}, binary)


@given(messages=st.lists(st.tuples(st.binary(max_size=50), st.booleans())), cut=st.integers(1, 20))
def test_frames_survive_any_cut(messages: list[tuple[bytes, bool]], cut: int) -> None:
    stream = b"".join(frame(*message) for message in messages)
    unframer = Unframer()
    arrived = [m for i in range(0, len(stream), cut) for m in unframer.feed(stream[i : i + cut])]
    assert arrived == messages


def test_a_frame_beyond_all_limits_is_refused() -> None:
    with pytest.raises(MessageError):
        Unframer().feed(b"\x00\xff\xff\xff\xff")


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        (None, "scene"),
        ({}, "scene.robot"),
        ({"robot": "/etc/robot.yaml"}, "scene.robot"),
        ({"robot": "ur5e", "urdf": "<robot/>"}, "scene.robot"),
        ({"robot": ["ur5e"]}, "scene.robot"),
        ({"robot": "ur5e", "kinematics": "/etc/passwd"}, "scene.kinematics"),
        ({"robot": "ur5e", "detail": "skin"}, "scene.detail"),
        ({"robot": "ur5e", "gravity": -1.0}, "scene.gravity"),
        ({"robot": "ur5e", "mountign": "ceiling"}, "scene.mountign"),
        ({"robot": "ur5e", "base_wrench": {"force_noise": "x"}}, "scene.base_wrench.force_noise"),
        ({"robot": "ur5e", "self": 1}, "scene.self"),
        ({"robot": "ur5e", b"gravity": 9.81}, "scene"),
        ({"urdf": "<robot/>"}, "scene.surface"),
        ({"urdf": 3, "surface": ""}, "scene.urdf"),
        (
            {"urdf": "<!DOCTYPE r [<!ENTITY x SYSTEM 'file:///etc/passwd'>]><robot/>", "surface": ""},
            "scene.urdf",
        ),
        ({"urdf": "<?xml version='1.0' encoding='UTF-7'?><robot/>", "surface": ""}, "scene.urdf"),
        ({"urdf": "<robot", "surface": "robot: own\nlinks: {}"}, "scene.urdf"),
        ({"urdf": "<robot/>", "surface": "links: ["}, "scene.surface"),
        ({"urdf": "<robot/>", "surface": "a: &a [1]\nb: [*a, *a]"}, "scene.surface"),
    ],
)
def test_scenes_that_cannot_be_used(fields: Any, field: str) -> None:
    with pytest.raises(MessageError) as caught:
        make_scene(fields)
    assert caught.value.field == field


def test_a_scene_of_the_library() -> None:
    scene = make_scene({"robot": "ur10e", "mounting": "ceiling", "joint_torque": None})
    assert (scene.robot.name, scene.mounting, scene.joint_torque) == ("ur10e", "ceiling", None)


def test_a_scene_with_its_own_urdf() -> None:
    pytest.importorskip("yourdfpy")
    link = (
        "<inertial><mass value='2'/><inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial>"
    )
    urdf = (
        f"<robot name='own'><link name='base'>{link}</link><link name='arm'>{link}</link>"
        "<joint name='turn' type='revolute'><parent link='base'/><child link='arm'/>"
        "<axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='9' velocity='1'/></joint></robot>"
    )
    body = "{kind: sphere, center: [0, 0, 0.1], radius: 0.1}"
    surface = f"robot: own\nlinks: {{arm: {{fine: [{body}], coarse: [{body}]}}}}\n"
    scene = make_scene({"urdf": urdf, "surface": surface, "tip": "arm"})
    assert scene.link_names == ("base", "arm")
    assert len(scene.robot.links[1].primitives) == 1
    for wrong, field in (({"surface": "links: {}"}, "scene.surface"), ({"tip": "hand"}, "scene.urdf")):
        with pytest.raises(MessageError) as refused:
            make_scene({"urdf": urdf, "surface": surface, "tip": "arm", **wrong})
        assert refused.value.field == field
        # The text has no name of a file that the controller did not send.
        assert "robot." not in str(refused.value)
