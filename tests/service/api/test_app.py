"""The service as its users meet it: a real server, a real client."""

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from contactsense import Scene, forward_model, robots
from contactsense.service.api.app import create_app
from contactsense.service.api.messages import ErrorOut, EstimateOut
from contactsense.service.api.settings import Settings
from contactsense.service.mock.arm.newton_euler import inverse_dynamics
from tests.service import fakes, http
from tests.service.loopback import until
from tests.service.serving import serving

ZERO6 = [0.0] * 6
POSTURE = [0.0, -1.3, 1.6, -1.9, -1.57, 0.0]


@pytest.fixture(scope="module")
def idle() -> Iterator[httpx.Client]:
    """A service without a robot."""
    with (
        serving(create_app(Settings())) as place,
        httpx.Client(base_url=f"http://{place}", timeout=280) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def steady() -> Iterator[str]:
    """A service whose robot is pushed at its forearm all the time; yields host and port."""
    with serving(create_app(Settings(), fakes.Steady)) as place:
        deadline = time.monotonic() + 280  # kernels may have to be compiled
        while http.get(f"http://{place}/v1/health").json()["status"] != "ok":
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield place


def test_health_without_a_robot(idle: httpx.Client) -> None:
    health = idle.get("/v1/health").json()
    assert health["status"] == "idle"
    assert "POST /v1/locate" in health["message"]


def test_robot_and_scene(idle: httpx.Client) -> None:
    robot = idle.get("/v1/robot").json()
    assert robot["name"] == "ur5e"
    assert robot["mass"] == pytest.approx(21.7)
    assert len(robot["links"]) == len(robot["joints"]) + 1
    # JSON has no infinity: a limit that a joint does not have is null, as the description says.
    joint = idle.get("/openapi.json").json()["components"]["schemas"]["JointOut"]["properties"]
    assert all({"type": "null"} in joint[name]["anyOf"] for name in ("velocity_limit", "torque_limit"))
    scene = idle.get("/v1/scene").json()
    assert scene["links"] == [link["name"] for link in robot["links"]]
    assert scene["gravity_base"] == [0.0, 0.0, -9.81]
    assert scene["scene"]["robot"] == "ur5e"


def test_no_estimate_without_a_robot(idle: httpx.Client) -> None:
    answer = idle.get("/v1/contacts")
    assert answer.status_code == 503
    assert "no robot is configured" in answer.json()["errors"][0]["reason"]


@pytest.mark.slow
def test_locate_one(idle: httpx.Client) -> None:
    sample = {"q": POSTURE, "base_wrench": [0.0, 0.0, -30.0, 0.0, 6.0, 0.0]}
    answer = idle.post("/v1/locate", json=sample)
    assert answer.status_code == 200
    estimate = EstimateOut.model_validate(answer.json())
    assert estimate.status in ("contact", "ambiguous")


@pytest.mark.slow
def test_the_examples_of_the_description_can_be_sent(idle: httpx.Client) -> None:
    operation = idle.get("/openapi.json").json()["paths"]["/v1/locate"]["post"]
    examples = operation["requestBody"]["content"]["application/json"]["examples"]
    one, several = (idle.post("/v1/locate", json=each["value"]).json() for each in examples.values())
    assert several == {"estimates": [one, one]}
    assert one["contacts"][0]["link"] == "forearm"
    assert np.linalg.norm(one["contacts"][0]["force_base"]) == pytest.approx(20, abs=0.1)


def test_locate_many(idle: httpx.Client) -> None:
    samples = [
        {"q": POSTURE, "base_wrench": ZERO6},
        {"q": POSTURE, "joint_torque": [0.0, 40.0, 20.0, 0.0, 0.0, 0.0]},
    ]
    answer = idle.post("/v1/locate", json={"samples": samples})
    assert answer.status_code == 200
    first, second = (EstimateOut.model_validate(item) for item in answer.json()["estimates"])
    assert first.status == "none"
    assert second.status != "none"


SEVERAL = """
robot: ur5e
base_wrench: {force_noise: 0.02, moment_noise: 0.004}
joint_torque: {noise: 0.02}
contacts: 2
"""


@pytest.mark.slow
def test_locate_several_contacts(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SEVERAL)
    scene, posture = Scene.load(path), np.array(POSTURE)
    touches = (
        ("upper_arm", [-0.25, 0.0, 0.19], [0.0, 3.0, -20.0]),
        ("wrist_2", [0.0, 0.0, 0.05], [9.0, 0.0, 12.0]),
    )
    readings = [
        forward_model(scene, posture, link, np.array(point), np.array(force), external=True)
        for link, point, force in touches
    ]
    sample = {
        "q": POSTURE,
        "base_wrench": np.sum([r.base_wrench for r in readings], axis=0).tolist(),
        "joint_torque": np.sum([r.joint_torque for r in readings], axis=0).tolist(),
    }
    with serving(create_app(Settings(scene=path))) as place:
        answers = [
            http.post(f"http://{place}/v1/locate", json={**sample, **more}, timeout=280.0)
            for more in ({}, {"contacts": 2}, {"contacts": 3})
        ]
    one, two = (EstimateOut.model_validate(answer.json()) for answer in answers[:2])
    assert one.status != "multiple"
    assert two.status == "multiple"
    assert {contact.link for contact in two.contacts} == {link for link, _, _ in touches}
    (error,) = ErrorOut.model_validate(answers[2].json()).errors
    assert (error.field, error.reason) == ("contacts", "expected at most 2, as the scene states, got 3")


def test_locate_takes_the_weight_off_on_request(idle: httpx.Client) -> None:
    still = np.zeros((1, 6))
    torque, wrench = inverse_dynamics(robots.load("ur5e"), np.array([POSTURE]), still, still)
    sample = {"q": POSTURE, "base_wrench": wrench[0].tolist(), "joint_torque": torque[0].tolist()}
    assert idle.post("/v1/locate", json={**sample, "external": False}).json()["status"] == "none"
    torques = {"q": POSTURE, "joint_torque": torque[0].tolist()}
    assert idle.post("/v1/locate", json={**torques, "external": True}).json()["status"] != "none"


def test_raw_readings_are_not_taken_for_a_contact(idle: httpx.Client) -> None:
    still = np.zeros((1, 6))
    _, wrench = inverse_dynamics(robots.load("ur5e"), np.array([POSTURE]), still, still)
    sample = {"q": POSTURE, "base_wrench": wrench[0].tolist()}
    answer = idle.post("/v1/locate", json={"samples": [{**sample, "base_wrench": ZERO6}, sample]})
    assert answer.status_code == 422
    (error,) = ErrorOut.model_validate(answer.json()).errors
    assert error.field == "samples[1].base_wrench"
    assert "for raw readings external must be false" in error.reason


@pytest.mark.parametrize(
    ("changes", "field", "reason"),
    [
        ({"q": [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]}, "q", "are they in degrees?"),
        ({"base_wrench": [0.0, 0.0, 19e3, 0.0, 0.0, 0.0]}, "base_wrench", "got 19000 N"),
        ({"joint_torque": [0.0, 0.0, 0.0, 0.0, 500.0, 0.0]}, "joint_torque", "2.5 times the 28 Nm"),
    ],
)
def test_locate_refuses_what_cannot_be(
    idle: httpx.Client, changes: dict[str, list[float]], field: str, reason: str
) -> None:
    answer = idle.post("/v1/locate", json={"q": POSTURE, "base_wrench": ZERO6, **changes})
    assert answer.status_code == 422
    (error,) = ErrorOut.model_validate(answer.json()).errors
    assert error.field == field
    assert reason in error.reason


GOOD = {"q": POSTURE, "base_wrench": ZERO6}


@pytest.mark.parametrize(
    ("body", "field", "reason"),
    [
        (json.dumps(GOOD).replace("-1.3", "NaN"), "q[1]", "finite number, got nan"),
        (json.dumps(GOOD).replace("-1.3", "-Infinity"), "q[1]", "finite number, got -inf"),
        (json.dumps(GOOD).replace("-1.3", "1e999"), "q[1]", "finite number, got inf"),
        (json.dumps(GOOD).replace("-1.3", '"-1.3"'), "q[1]", "number, got '-1.3'"),
        (json.dumps(GOOD).replace("-1.3, ", ""), "q", "expected 6 numbers, one per joint of ur5e, got 5"),
        (json.dumps({**GOOD, "base_wrench": [0.0]}), "base_wrench", "a length of at least 6, got 1"),
        (json.dumps({**GOOD, "joint_torque": [0.0]}), "joint_torque", "expected 6 numbers"),
        (json.dumps({**GOOD, "torque": 1}), "torque", "unknown field (did you mean joint_torque?), got 1"),
        (json.dumps({**GOOD, "one": 1}), "one", "unknown field (known: "),
        (json.dumps({"samples": [{**GOOD, "many": 1}]}), "samples[0].many", "unknown field (known: "),
        (json.dumps({**GOOD, "contacts": 4}), "contacts", "number of at most 3, got 4"),
        (json.dumps({**GOOD, "contacts": 2}), "contacts", "expected at most 1, as the scene states, got 2"),
        (json.dumps({**GOOD, "external": "no"}), "external", "expected true or false, got 'no'"),
        (json.dumps({**GOOD, "wrist_wrench": ZERO6}), "wrist_wrench", "the scene has no such sensor"),
        pytest.param('{"q": [' + 5000 * "1" + "]}", "q[0]", "expected a finite number, got inf", id="digits"),
        (json.dumps({"q": POSTURE}), "base_wrench", "got neither"),
        (json.dumps({"q": POSTURE, "wrist_wrench": ZERO6}), "wrist_wrench", "the scene has no such sensor"),
        (json.dumps({"base_wrench": ZERO6}), "q", "the field is missing"),
        (json.dumps({"samples": []}), "samples", "a length of at least 1, got 0"),
        (json.dumps({"samples": [GOOD, {**GOOD, "q": [0.0]}]}), "samples[1].q", "expected 6 numbers"),
        (json.dumps({"samples": [GOOD, {**GOOD, "q": None}]}), "samples[1].q", "list, got null"),
        (json.dumps({**GOOD, "\ud800": 1}), "", "unicode"),
        (json.dumps({**GOOD, "q": "\ud800"}), "q", "list"),
        ("{", "", "not JSON"),
        ('{"q": [0, 0, 0, 0, 0, 0], "q": [1, 1, 1, 1, 1, 1]}', "q", "expected once, got twice"),
        (
            json.dumps({f"a{i}": 0 for i in range(1001)}),
            "",
            "expected at most 1000 names in an object, got 1001",
        ),
        (json.dumps({"samples": [{**GOOD, "q": ["x"]}] * 5000}), "samples[0].q[0]", "a number, got 'x'"),
        (json.dumps({**GOOD, "q": ["x"] * 100_000}), "q", "a length of at most 64, got 100000"),
        ("[]", "", "expected an object with fields"),
        ("", "", "expected a body in JSON, got none"),
    ],
)
def test_bad_input_is_named(idle: httpx.Client, body: str, field: str, reason: str) -> None:
    answer = idle.post("/v1/locate", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert reason in error["reason"]


def test_other_errors_have_the_same_form(idle: httpx.Client) -> None:
    assert idle.get("/v1/nothing").json() == {
        "errors": [{"field": "", "reason": "there is no /v1/nothing; GET /docs describes the interface"}]
    }
    answer = idle.get("/v1/locate")
    assert answer.status_code == 405
    assert answer.json()["errors"][0]["reason"] == "/v1/locate: expected POST, got GET"
    deep = idle.post("/v1/locate", content="[" * 100_000, headers={"content-type": "application/json"})
    assert deep.status_code == 400
    assert "expected a body in JSON" in deep.json()["errors"][0]["reason"]


@pytest.mark.parametrize(
    "path", ["/v1/health", "/v1/ready", "/docs", "/openapi.json", "/v1/nothing", "/v1/locate"]
)
def test_head_is_get_without_the_body(idle: httpx.Client, path: str) -> None:
    head, get = idle.head(path), idle.get(path)
    assert head.status_code == get.status_code
    assert head.headers["content-type"] == get.headers["content-type"]
    assert head.content == b""
    assert get.content
    # The connection is in order for the next request.
    assert idle.get("/v1/robot").json()["name"] == "ur5e"


def test_the_path_of_a_websocket_says_so(idle: httpx.Client) -> None:
    for path in ("/v1/stream", "/v1/track"):
        answer = idle.get(path)
        assert answer.status_code == 426
        assert answer.headers["upgrade"] == "websocket"
        reason = f"{path}: expected a WebSocket, got an HTTP request"
        assert answer.json() == {"errors": [{"field": "", "reason": reason}]}


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/v1/strea", "there is no WebSocket /v1/strea; GET /docs describes the interface"),
        ("/v1/contacts", "/v1/contacts: expected an HTTP request, got a WebSocket"),
        ("/v1/locate", "/v1/locate: expected an HTTP request, got a WebSocket"),
    ],
)
def test_a_websocket_to_another_path_is_told(idle: httpx.Client, path: str, reason: str) -> None:
    """Not with 403, which is what a missing token or a foreign page gets."""
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(f"ws://{idle.base_url.host}:{idle.base_url.port}{path}"),
    ):
        pass
    assert refused.value.response.status_code == 404
    assert json.loads(refused.value.response.body) == {"errors": [{"field": "", "reason": reason}]}


def test_a_body_that_is_not_declared_as_json(idle: httpx.Client) -> None:
    """The default of curl: the body would be taken for text without fields."""
    form = "application/x-www-form-urlencoded"
    answer = idle.post("/v1/locate", content=json.dumps(GOOD), headers={"content-type": form})
    assert answer.status_code == 422
    assert answer.json()["errors"] == [
        {"field": "", "reason": f"expected the header Content-Type: application/json, got {form}"}
    ]


def test_the_interface_tells_units_and_frames(idle: httpx.Client) -> None:
    schemas = idle.get("/openapi.json").json()["components"]["schemas"]
    for name in ("SampleIn", "LocateOneIn", "ContactOut", "EstimateOut"):
        for field, description in schemas[name]["properties"].items():
            assert description.get("description"), f"{name}.{field}"
    assert "base frame [m]" in schemas["ContactOut"]["properties"]["point_base"]["description"]


@pytest.mark.slow
def test_the_latest_estimate(steady: str) -> None:
    answers: list[httpx.Response] = []

    def answered() -> bool:  # where the host stood still, the latest one is too old for a moment
        answers.append(http.get(f"http://{steady}/v1/contacts"))
        return answers[-1].status_code == 200

    assert until(answered, 60.0)
    answer = answers[-1]
    estimate = EstimateOut.model_validate(answer.json())
    assert estimate.status in ("contact", "ambiguous")
    assert len(estimate.link_probability) == 7


@pytest.mark.slow
def test_the_stream(steady: str) -> None:
    """Every estimate in turn; of those that a busy computer loses, their number."""
    with connect(f"ws://{steady}/v1/stream", close_timeout=0.5) as stream:
        messages = [json.loads(stream.recv(timeout=60)) for _ in range(100)]
    count, found = 0, list[tuple[int, float]]()
    for message in messages:
        if "lost" in message:
            count += message["lost"]
        else:
            found.append((count, EstimateOut.model_validate(message).t))
            count += 1
    first, begin = found[0]
    assert all(t - begin == pytest.approx(0.002 * (number - first)) for number, t in found)


def test_the_stream_thinned_out(steady: str) -> None:
    with connect(f"ws://{steady}/v1/stream?every=10") as stream:
        times = [json.loads(stream.recv(timeout=60))["t"] for _ in range(5)]
    assert times[4] - times[0] == pytest.approx(0.08)
    with connect(f"ws://{steady}/v1/stream?rate=20") as stream:
        times = [json.loads(stream.recv(timeout=60))["t"] for _ in range(5)]
    assert times[4] - times[0] == pytest.approx(0.2, abs=0.01)


def test_readers_are_counted(steady: str) -> None:
    with connect(f"ws://{steady}/v1/stream", close_timeout=0.5) as stream:
        stream.recv(timeout=60)
        readers = http.get(f"http://{steady}/v1/health").json()["stream"]["readers"]
        assert readers >= 1


def test_a_reader_that_is_too_slow_is_told(steady: str) -> None:
    # A reader that takes nothing: its own buffers, the server's, then the hub's queue fill up.
    host, port = steady.split(":")
    narrow = socket.socket()
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    narrow.connect((host, int(port)))
    with connect(f"ws://{steady}/v1/stream", sock=narrow, max_queue=1, close_timeout=0.5) as stream:
        stream.recv(timeout=60)
        deadline = time.monotonic() + 60
        while http.get(f"http://{steady}/v1/health").json()["stream"]["lost"] < 10:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        while "lost" not in (message := json.loads(stream.recv(timeout=60))):
            pass
        assert message["lost"] >= 1
        assert "t" in json.loads(stream.recv(timeout=60))


@pytest.mark.parametrize(
    ("query", "field"),
    [("every=0", "every"), ("rate=nan", "rate"), ("rate=5e-324", "rate"), ("every=" + "ä" * 99, "every")],
)
def test_a_stream_asked_for_wrongly(steady: str, query: str, field: str) -> None:
    with connect(f"ws://{steady}/v1/stream?{query}") as stream:
        (error,) = json.loads(stream.recv(timeout=60))["errors"]
        assert error["field"] == field
        with pytest.raises(ConnectionClosedError, match=field) as closed:
            stream.recv(timeout=60)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008
