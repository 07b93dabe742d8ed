"""Reactions over the whole way: mock controller, pipeline, registers, HTTP, journal."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from contactsense.scene import Scene
from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.cli.main import cli
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.recordings import read
from contactsense.service.recordings.export import export, write_columns
from tests.service import http
from tests.service.loopback import until
from tests.service.serving import serving

PUSH = {
    "link": "forearm",
    "point": [-0.1747, 0.0373, 0.0095],
    "normal": [-0.0008, 0.9931, 0.1174],
    "push": 30.0,
    "start": 1.0,
    "duration": 0.5,
}
SCRIPT = Script.model_validate(
    {
        "robot": "ur5e",
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
        "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 4.0},
        "contacts": [PUSH],
    }
)
RULES = {
    "actions": {"tell": {"type": "registers"}, "note": {"type": "command", "command": ["true"]}},
    "rules": [{"name": "arm", "links": ["any"], "collision": {"force": 20.0, "actions": ["tell", "note"]}}],
    "expected": [{"name": "insert", "links": ["wrist_3"], "force": 100.0}],
}


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[MockServers, str]]:
    chosen = MockSettings(rtde_port=0, netft_port=0, http_port=0, loop=True)
    with MockServers(simulate(SCRIPT), chosen) as servers:
        rules = tmp_path / "reactions.yaml"
        rules.write_text(yaml.safe_dump({**RULES, "robot": {"rtde_port": servers.rtde.port}}))
        settings = Settings.checked(
            {
                "robot_host": chosen.host,
                "robot_port": servers.rtde.port,
                "ft_host": chosen.host,
                "ft_port": servers.netft.port,
                "ft_http_port": servers.netft.http_port,
                "reactions": {"file": rules},
            }
        )
        with serving(create_app(settings)) as place:
            yield servers, f"http://{place}"


@pytest.mark.slow
def test_a_touch_becomes_a_register_an_event_and_a_latch(served: tuple[MockServers, str]) -> None:
    servers, url = served
    inputs = servers.rtde.controller.inputs
    collision = {"kind": "collision"}
    assert until(lambda: http.get(f"{url}/v1/events", params=collision).json()["events"], 250.0, step=0.05)
    (event, *_) = http.get(f"{url}/v1/events", params=collision).json()["events"]
    assert (event["rule"], event["link"]) == ("arm", "forearm")
    assert until(lambda: inputs.get("input_int_register_47") == (42,))
    assert until(lambda: http.get(f"{url}/v1/reactions").json()["latched"])
    state = http.get(f"{url}/v1/reactions").json()
    assert state["latched"][0]["link"] == "forearm"
    assert "collision above 20 N" in state["rules"][0]
    assert until(lambda: http.get(f"{url}/v1/health").json()["reactions"]["actions"]["note"]["state"] == "ok")
    assert until(lambda: http.get(f"{url}/v1/contacts").json().get("status") == "none")
    acknowledged = http.post(f"{url}/v1/reactions/acknowledge")
    assert acknowledged.status_code == 200
    assert acknowledged.json()["latched"] == []
    assert until(lambda: inputs["input_int_register_47"] == (0,))
    opened = http.post(f"{url}/v1/reactions/expected", json={"name": "insert"})
    assert opened.json()["expected"] == ["insert"]
    refused = http.post(f"{url}/v1/reactions/expected", json={"name": "remove"})
    assert refused.status_code == 422
    assert refused.json() == {"errors": [{"field": "name", "reason": "expected one of insert, got 'remove'"}]}
    assert http.post(f"{url}/v1/reactions/acknowledge", json={"rule": "leg"}).status_code == 422
    kinds = [e["kind"] for e in http.get(f"{url}/v1/events").json()["events"]]
    assert {"onset", "collision", "action", "acknowledged", "expected"} <= set(kinds)


def test_without_rules() -> None:
    with serving(create_app(Settings())) as place:
        assert http.get(f"http://{place}/v1/reactions").json()["status"] == "off"
        assert http.post(f"http://{place}/v1/reactions/acknowledge").status_code == 503
        assert http.post(f"http://{place}/v1/reactions/expected", json={"name": "insert"}).status_code == 503


def test_rules_that_do_not_fit_are_refused_at_the_start(tmp_path: Path) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text(yaml.safe_dump(RULES))
    with pytest.raises(
        SettingsError, match=r"robot\.host: expected the controller's address for tell, got none"
    ):
        create_app(Settings.checked({"reactions": {"file": rules}}))
    rules.write_text("rules: [{name: a, links: [leg], contact: {force: 5}}]")
    with pytest.raises(SettingsError, match=r"rules: a: links: expected some of .* got 'leg'"):
        create_app(Settings.checked({"reactions": {"file": rules}}))


def test_rules_beside_the_scene_are_found(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("robot: ur5e")
    (tmp_path / "reactions.yaml").write_text("rules: [{name: a, links: [any], contact: {force: 5}}]")
    app = create_app(Settings(scene=tmp_path / "scene.yaml"))
    assert app.state.service.reactions.rules.rules[0].name == "a"


def test_check_explains_and_replays(tmp_path: Path) -> None:
    motion = simulate(SCRIPT)
    columns = {"timestamp": motion.t}
    for name, values in (
        ("actual_q", motion.q),
        ("actual_qd", motion.qd),
        ("joint_torque", motion.joint_torque),
        ("base_wrench", motion.base_wrench),
    ):
        columns |= {f"{name}_{i}": column for i, column in enumerate(np.asarray(values).T)}
    write_columns(tmp_path / "push.parquet", columns)
    (tmp_path / "rules.yaml").write_text(yaml.safe_dump({**RULES, "robot": {"host": "192.0.2.1"}}))
    arguments = ["reactions", "check", str(tmp_path / "rules.yaml")]
    told = CliRunner().invoke(cli, [*arguments, "--replay", str(tmp_path / "push.parquet")])
    assert told.exit_code == 0, told.output
    assert "arm: on any link: collision above 20 N with probability 0.9: tell, note, latched" in told.output
    assert told.output.count("action tell: write input_int_register_47") == 1
    assert ": a level would have been exceeded once" in told.output
    result = CliRunner().invoke(cli, [*arguments, "--replay", str(tmp_path / "push.parquet"), "--json"])
    (fired,) = json.loads(result.stdout)["fired"]
    assert 1.0 < fired["t"] < 1.5
    assert fired["link"] == "forearm"


def test_a_replay_uses_the_scene_of_the_recording_and_says_where_it_does_not_fit(tmp_path: Path) -> None:
    """Or thresholds are chosen by forces that are none."""
    motion, columns = simulate(SCRIPT), {}
    for name, values in (
        ("actual_q", motion.q),
        ("actual_qd", motion.qd),
        ("base_wrench", motion.base_wrench),
    ):
        columns |= {f"{name}_{i}": column for i, column in enumerate(np.asarray(values).T)}
    plain, own = tmp_path / "plain.csv", tmp_path / "own.parquet"
    write_columns(plain, {"timestamp": motion.t, **columns})
    (tmp_path / "right.yaml").write_text("{robot: ur5e, joint_torque: null}")
    (tmp_path / "tilted.yaml").write_text("{robot: ur5e, joint_torque: null, mounting: [0.1, 0, 0]}")
    (tmp_path / "rules.yaml").write_text("rules: [{name: a, links: [any], contact: {force: 10}}]")
    tilted = Scene.load(tmp_path / "tilted.yaml")
    export(read(plain, Scene.load(tmp_path / "right.yaml")), own, scene=tilted)
    arguments = ["reactions", "check", str(tmp_path / "rules.yaml"), "--replay"]
    doubt = "check: the readings have not fitted a free arm since the stream began"
    for more in ([str(own)], [str(plain), "--scene", str(tmp_path / "tilted.yaml")]):
        result = CliRunner().invoke(cli, [*arguments, *more])
        assert doubt in result.stderr
    assert "check: estimates were degraded" not in result.stderr
    result = CliRunner().invoke(cli, [*arguments, str(own), "--scene", str(tmp_path / "right.yaml")])
    assert result.exit_code == 0
    assert doubt not in result.stderr
    result = CliRunner().invoke(cli, [*arguments, str(own), "--scene", "right.yaml", "--robot", "ur10e"])
    assert result.exit_code == 2
    assert "--robot and --scene: expected one of them" in result.stderr


@pytest.mark.slow
def test_check_does_not_say_that_nothing_fires_in_a_recording_that_cannot_be_used(tmp_path: Path) -> None:
    motion = simulate(SCRIPT)
    columns = {"time": 1000.0 * motion.t[:500]}
    for name, values in (
        ("actual_q", motion.q),
        ("actual_qd", motion.qd),
        ("base_wrench", motion.base_wrench),
    ):
        columns |= {f"{name}_{i}": column for i, column in enumerate(np.asarray(values)[:500].T)}
    write_columns(tmp_path / "free.parquet", columns)
    (tmp_path / "rules.yaml").write_text("rules: [{name: a, links: [any], contact: {force: 5}}]")
    arguments = [
        "reactions",
        "check",
        str(tmp_path / "rules.yaml"),
        "--replay",
        str(tmp_path / "free.parquet"),
    ]
    result = CliRunner().invoke(cli, [*arguments, "--columns", "timestamp=time"])
    assert result.exit_code == 1
    assert "no sample could be used: whether a rule would have fired is not known" in result.output
    assert "no rule would have fired" not in result.output
    result = CliRunner().invoke(cli, [*arguments, "--columns", "timestamp=time,time_unit=ms"])
    assert result.exit_code == 0, result.output
    assert "no rule would have fired" in result.output
    assert "check: no joint_torque_0" in result.output
    # With joint torques alone, no force is sure to be detected, but some are.
    torques = {name: values for name, values in columns.items() if "base" not in name}
    torques |= {f"joint_torque_{i}": column for i, column in enumerate(motion.joint_torque[:500].T)}
    write_columns(tmp_path / "free.parquet", torques)
    result = CliRunner().invoke(cli, [*arguments, "--columns", "timestamp=time,time_unit=ms"])
    assert result.exit_code == 0, result.output
    assert "no rule would have fired" in result.output
    assert CliRunner().invoke(cli, [*arguments, "--columns", "time=time"]).exit_code == 1


def slow_rules(folder: Path) -> Path:
    """Rules that lower the slider of a robot that cannot be reached."""
    rules = {
        "robot": {"host": "192.0.2.1"},
        "actions": {"slow": {"type": "speed_slider", "fraction": 0.1, "restore": 1.0}},
        "rules": [{"name": "arm", "links": ["any"], "contact": {"force": 20.0, "actions": ["slow"]}}],
    }
    (folder / "rules.yaml").write_text(yaml.safe_dump(rules))
    return folder / "rules.yaml"


def test_a_rule_that_cannot_latch_cannot_be_acknowledged(tmp_path: Path) -> None:
    rules = {
        "robot": {"host": "192.0.2.1"},
        "rules": [
            {"name": "touch", "links": ["any"], "contact": {"force": 20.0}},
            {"name": "hit", "links": ["any"], "collision": {"force": 20.0}},
        ],
    }
    (tmp_path / "rules.yaml").write_text(yaml.safe_dump(rules))
    with serving(create_app(Settings.checked({"reactions": {"file": tmp_path / "rules.yaml"}}))) as place:
        url = f"http://{place}/v1/reactions/acknowledge"
        refused = http.post(url, json={"rule": "touch"})
        assert refused.status_code == 422
        reason = "expected a rule with a level `collision`: one of hit, got 'touch'"
        assert refused.json() == {"errors": [{"field": "rule", "reason": reason}]}
        assert http.post(url, json={"rule": "hit"}).status_code == 503  # no pipeline runs
    rules["rules"] = rules["rules"][:1]
    (tmp_path / "rules.yaml").write_text(yaml.safe_dump(rules))
    with serving(create_app(Settings.checked({"reactions": {"file": tmp_path / "rules.yaml"}}))) as place:
        refused = http.post(f"http://{place}/v1/reactions/acknowledge", json={"rule": "touch"})
        assert "none, as no rule has one" in refused.text


def test_check_says_what_a_slider_needs_to_be_raised_after_a_restart(tmp_path: Path) -> None:
    arguments = ["reactions", "check", str(slow_rules(tmp_path))]
    told = CliRunner().invoke(cli, arguments)
    assert told.exit_code == 0, told.output
    assert "warning: action slow: without --journal FILE the speed slider stays low" in told.stderr
    (text,) = json.loads(CliRunner().invoke(cli, [*arguments, "--json"]).stdout)["without_journal"]
    assert text.startswith("action slow: without --journal FILE")


def test_the_end_of_the_service_tells_of_a_slider_that_is_low(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    app = create_app(Settings.checked({"reactions": {"file": slow_rules(tmp_path)}}))
    with serving(app):
        app.state.service.reactions.handle_report(
            {"started": False, "restored": True, "answer": None, "active": [], "expected": [],
             "actions": {}, "lowered": 0.1}
        )  # fmt: skip
        assert not any("the service ends with" in text for text in caplog.messages)
    assert any(
        "ends with the speed slider at 10 %: a force may still act" in text for text in caplog.messages
    )


@pytest.mark.parametrize("text", ["rules: []", "rules: [{name: a, links: [leg], contact: {force: 5}}]", "3"])
def test_check_refuses_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "rules.yaml").write_text(text)
    refused = CliRunner().invoke(cli, ["reactions", "check", str(tmp_path / "rules.yaml")])
    assert refused.exit_code == 1
    assert "rules.yaml" in refused.output
