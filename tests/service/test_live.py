"""Everything at once: mock arm, wire, clients, the pipeline's process, HTTP, WebSocket; and their faults."""

import json
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime

import httpx
import numpy as np
import pytest
from websockets.sync.client import connect

from contactsense.service.api.app import create_app
from contactsense.service.api.messages import EstimateOut, HealthOut
from contactsense.service.api.settings import Settings
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from contactsense.service.mock.interfaces.wire_faults import Fault
from contactsense.service.mock.servers import MockServers, MockSettings
from tests.service import http
from tests.service.loopback import own_address, until
from tests.service.serving import serving

SCRIPT = Script.model_validate(
    {
        "robot": "ur5e",
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
        "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 3.0},
        "contacts": [
            {
                "link": "forearm",
                "point": [-0.1747, 0.0373, 0.0095],
                "normal": [-0.0008, 0.9931, 0.1174],
                "push": 30,
                "start": 0.5,
                "duration": 1.0,
            },
            {
                "link": "upper_arm",
                "point": [-0.2699, 0.0425, 0.1348],
                "normal": [0.0003, 0.9958, -0.0913],
                "push": 30,
                "start": 2.0,
                "duration": 0.6,
            },
        ],
    }
)


class Play:
    """A mock arm that repeats the script, and a service that reads it."""

    def __init__(self, motion: Motion, servers: MockServers, place: str) -> None:
        self.motion, self.servers, self.place = motion, servers, place

    def health(self) -> HealthOut:
        return HealthOut.model_validate(http.get(f"http://{self.place}/v1/health").json())

    def until(self, condition: Callable[[HealthOut], bool]) -> HealthOut:
        deadline = time.monotonic() + 280.0  # kernels may have to be compiled
        while not condition(health := self.health()):
            assert time.monotonic() < deadline, health
            time.sleep(0.02)
        return health

    def contacts(self, status: int) -> httpx.Response:
        """The answer to `GET /v1/contacts`, once it has that status."""
        answers: list[httpx.Response] = []

        def answered() -> bool:
            answers.append(http.get(f"http://{self.place}/v1/contacts"))
            return answers[-1].status_code == status

        assert until(answered, 60.0)
        return answers[-1]


@pytest.fixture(scope="module")
def play() -> Iterator[Play]:
    motion = simulate(SCRIPT)
    chosen = MockSettings(host=own_address(), rtde_port=0, netft_port=0, http_port=0, loop=True)
    with MockServers(motion, chosen) as servers:
        settings = Settings(
            robot_host=chosen.host,
            robot_port=servers.rtde.port,
            ft_host=chosen.host,
            ft_port=servers.netft.port,
            ft_http_port=servers.netft.http_port,
        )
        with serving(create_app(settings)) as place:
            found = Play(motion, servers, place)
            found.until(lambda health: health.status == "ok")
            # Whoever answers single requests loads its kernels once the stream runs; as the mock lives in the
            # same process here, its sensor is held up meanwhile.
            body = {
                "q": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
                "base_wrench": [5.9, 2.4, -19.0, -1.1, -2.3, -0.6],
            }
            http.post(f"http://{place}/v1/locate", json=body, timeout=280.0).raise_for_status()
            yield found


@pytest.mark.slow
def test_contacts_are_found_over_the_wire(play: Play) -> None:
    """Judged are the estimates of samples with all readings: a host that stands still loses some of them, and
    the script is watched until there are enough."""
    found: dict[str, list[EstimateOut]] = {"forearm": [], "upper_arm": [], "nothing": []}
    without = "is missing", "is settling"
    with connect(f"ws://{play.place}/v1/stream", close_timeout=0.5) as stream:
        deadline = time.monotonic() + 280.0
        while min(len(found["forearm"]), len(found["upper_arm"]), 2 * len(found["nothing"])) <= 100:
            assert time.monotonic() < deadline, {what: len(estimates) for what, estimates in found.items()}
            message = stream.recv(timeout=60)
            if '"lost"' in str(message):
                continue
            estimate = EstimateOut.model_validate_json(message)
            phase = estimate.t % SCRIPT.duration
            for what, begin, end in (("forearm", 0.7, 1.4), ("upper_arm", 2.2, 2.5), ("nothing", 1.75, 1.95)):
                if begin < phase < end and not any(why in estimate.reason for why in without):
                    found[what].append(estimate)
    assert all(not estimate.contacts for estimate in found["nothing"])
    for touch in play.motion.touches:
        estimates = found[touch.link]
        right = [e.contacts[0] for e in estimates if e.contacts and e.contacts[0].link == touch.link]
        assert len(right) > 0.9 * len(estimates)
        off = [np.linalg.norm(np.array(contact.point) - touch.point_link) for contact in right]
        assert np.median(off) < 0.01
        assert np.median([np.linalg.norm(contact.force_base) for contact in right]) == pytest.approx(
            30.0, abs=1.0
        )


def test_the_latest_estimate_is_the_streams(play: Play) -> None:
    estimate = EstimateOut.model_validate(play.contacts(200).json())
    assert len(estimate.link_probability) == 7


@pytest.mark.parametrize(
    "fault",
    [
        Fault.MUTE,
        Fault.CLOSE,
        pytest.param(Fault.GARBAGE, marks=pytest.mark.slow),
        pytest.param(Fault.HALF, marks=pytest.mark.slow),
    ],
    ids=lambda fault: fault.name,
)
def test_a_robot_that_fails_is_told_of_and_found_again(play: Play, fault: Fault) -> None:
    begin = datetime.now(UTC).replace(microsecond=0)
    play.servers.rtde.fault = fault
    try:
        place = f"robot at {play.servers.rtde.host}:{play.servers.rtde.port}"
        told = "retrying" if fault is Fault.GARBAGE else place
        health = play.until(lambda health: health.status == "waiting" and told in health.message)
        assert "retrying" in health.message
        assert not health.source.connected
        assert "retrying" in play.contacts(503).json()["errors"][0]["reason"]
    finally:
        play.servers.rtde.fault = Fault.NONE
    health = play.until(lambda health: health.status == "ok")
    assert health.source.robot.last_error  # stays for whoever asks later
    assert health.source.robot.last_error_time is not None
    last = datetime.fromisoformat(health.source.robot.last_error_time)
    assert begin <= last <= datetime.now(UTC)
    assert health.pipeline.restarts == 0
    assert play.contacts(200)


@pytest.mark.slow
def test_a_mute_force_torque_sensor_is_told_of_and_the_rest_goes_on(play: Play) -> None:
    play.servers.netft.mute = True
    try:
        health = play.until(
            lambda health: health.status == "degraded" and "force/torque sensor" in health.message
        )
        assert health.source.connected
        with connect(f"ws://{play.place}/v1/stream", close_timeout=0.5) as stream:
            messages = [json.loads(stream.recv(timeout=60)) for _ in range(50)]
        assert "base_wrench" in [message["reason"] for message in messages if "reason" in message][-1]
    finally:
        play.servers.netft.mute = False
    play.until(lambda health: health.status == "ok")


@pytest.mark.slow
def test_numbers_that_are_none_do_no_harm(play: Play) -> None:
    play.servers.rtde.fault = Fault.NAN
    try:
        play.until(lambda health: "are not numbers" in health.message)
    finally:
        play.servers.rtde.fault = Fault.NONE
    health = play.until(lambda health: health.status == "ok")
    assert health.pipeline.restarts == 0
