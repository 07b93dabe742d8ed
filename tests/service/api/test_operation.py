"""Readiness, metrics, reload, logs."""

import asyncio
import errno
import importlib.metadata
import json
import logging
import logging.handlers
import os
import tempfile
from pathlib import Path

import pytest

from contactsense.service import logs
from contactsense.service.api.app import create_app
from contactsense.service.api.metrics import Metrics
from contactsense.service.api.service import Service
from contactsense.service.api.settings import Settings
from contactsense.service.live.health import SensorHealth, SourceHealth
from contactsense.service.reactions.health import ActionHealth, ReactionsHealth
from tests.service import fakes, http
from tests.service.serving import serving


def test_a_service_without_a_robot_is_ready() -> None:
    with serving(create_app(Settings())) as place:
        answer = http.get(f"http://{place}/v1/ready")
        assert answer.status_code == 200
        assert answer.json()["ready"] is True


def test_a_service_without_estimates_is_not_ready() -> None:
    with serving(create_app(Settings(), fakes.Mute)) as place:
        answer = http.get(f"http://{place}/v1/ready")
        assert answer.status_code == 503
        assert answer.json()["ready"] is False
        assert answer.json()["reasons"]
        health = http.get(f"http://{place}/v1/health")
        assert health.status_code == 200
        assert health.json()["ready"] is False
        assert "; ".join(health.json()["reasons"]) == health.json()["message"]


def test_metrics_are_prometheus_text() -> None:
    with serving(create_app(Settings())) as place:
        answer = http.get(f"http://{place}/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    lines = answer.text.splitlines()
    assert 'contactsense_status{status="idle"} 1.0' in lines
    assert "contactsense_ready 1.0" in lines
    assert "contactsense_pipeline_restarts_total 0.0" in lines


def test_steps_become_a_histogram() -> None:
    service = create_app(Settings()).state.service
    service.runner.pipeline.step_counts = [1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 4]
    service.runner.pipeline.step_sum = 0.5
    lines = service.metrics.text().decode().splitlines()
    assert 'contactsense_step_seconds_bucket{le="5e-05"} 3.0' in lines
    assert 'contactsense_step_seconds_bucket{le="+Inf"} 7.0' in lines
    assert "contactsense_step_seconds_sum 0.5" in lines


def test_every_sensor_on_the_network_has_its_counters() -> None:
    service = create_app(Settings()).state.service
    service.runner.source = SourceHealth(link_wrenches={"elbow": SensorHealth(received=7, lost=3)})
    lines = service.metrics.text().decode().splitlines()
    assert 'contactsense_received_total{sensor="link_wrenches.elbow"} 7.0' in lines
    assert 'contactsense_lost_total{sensor="link_wrenches.elbow"} 3.0' in lines
    assert service.health().source.link_wrenches["elbow"].lost == 3


def test_messages_that_could_not_be_handled_are_counted() -> None:
    service = create_app(Settings()).state.service
    for _ in range(2):
        service.runner.message_errors.add("report: OSError: disk full")
    pipeline = service.health().pipeline
    assert (pipeline.message_errors, pipeline.last_message_error) == (2, "report: OSError: disk full")


async def _reload(service: Service) -> None:
    async with service.running():
        await service.reload()


def test_a_reload_takes_a_good_scene_and_leaves_a_bad_one(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("robot: ur5e\n")
    service = create_app(Settings(scene=path)).state.service
    path.write_text("robot: ur10e\n")
    asyncio.run(_reload(service))
    assert service.reloaded.ok
    assert service.scene.robot.name == "ur10e"
    path.write_text("robot: none-such\n")
    asyncio.run(_reload(service))
    assert not service.reloaded.ok
    assert "none-such" in service.reloaded.message
    assert service.scene.robot.name == "ur10e"
    assert service.health().reload == service.reloaded


def test_a_reload_does_not_need_the_folder_for_recordings(tmp_path: Path) -> None:
    path, folder = tmp_path / "scene.yaml", tmp_path / "recordings"
    path.write_text("robot: ur5e\n")
    settings = Settings.model_validate({"scene": path, "recording": {"folder": folder}})
    service = create_app(settings).state.service
    folder.rmdir()
    folder.write_text("a disk that is away, or can only be read")
    path.write_text("robot: ur10e\n")
    asyncio.run(_reload(service))
    assert service.reloaded.ok
    assert service.scene.robot.name == "ur10e"


@pytest.mark.parametrize("pipeline", [False, True])
def test_a_reload_tells_of_a_restart_only_where_a_pipeline_runs(
    pipeline: bool, caplog: pytest.LogCaptureFixture
) -> None:
    service = create_app(Settings(), fakes.Mute if pipeline else None).state.service
    with caplog.at_level(logging.INFO, logger="contactsense"):
        asyncio.run(_reload(service))
    (line,) = [text for text in caplog.messages if text.startswith("reload: ")]
    assert ("the pipeline is being restarted" in line) == pipeline


def test_reloads_at_the_same_time_leave_one_delivery_of_each_webhook(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("robot: ur5e\n")
    (tmp_path / "reactions.yaml").write_text(
        "actions: {tell: {type: webhook, url: 'http://127.0.0.1:1/', secret: whsec_" + 32 * "A" + "}}\n"
        "rules: [{name: a, links: [any], contact: {force: 5, actions: [tell]}}]\n"
    )
    service = create_app(Settings(scene=path)).state.service

    async def reload() -> list[str]:
        async with service.running():
            await asyncio.gather(service.reload(), service.reload())
            return [task.get_name() for task in asyncio.all_tasks()]

    assert asyncio.run(reload()).count("deliveries of webhook tell") == 1


def test_rules_beside_the_scene_are_reloaded_and_may_forbid_it(tmp_path: Path) -> None:
    path, rules = tmp_path / "scene.yaml", tmp_path / "reactions.yaml"
    path.write_text("robot: ur5e\n")
    rules.write_text("rules: [{name: a, links: [any], contact: {force: 5}}]")
    service = create_app(Settings(scene=path)).state.service
    path.write_text("robot: ur10e\n")
    for bad in ("rules: [{name: b, links: [leg], contact: {force: 5}}]", "actions: {x: {type: registers}}"):
        rules.write_text(bad)
        asyncio.run(_reload(service))
        assert service.scene.robot.name == "ur5e"
        assert "reactions.yaml" in service.reloaded.message
        assert service.reactions.rules.rules[0].name == "a"
    rules.write_text("rules: [{name: b, links: [any], contact: {force: 5}}]")
    asyncio.run(_reload(service))
    assert service.reloaded.ok
    assert service.reactions.rules.rules[0].name == "b"
    assert service.scene.robot.name == "ur10e"


@pytest.fixture
def _restored() -> object:
    root = logging.getLogger()
    level, handlers = root.level, root.handlers[:]
    yield
    for handler in root.handlers:
        if handler not in handlers:
            handler.close()
    root.level, root.handlers[:] = level, handlers


@pytest.mark.usefixtures("_restored")
def test_the_log_as_json_in_a_file_of_bounded_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "FILE_SIZE", 2000)
    path = tmp_path / "log"
    logs.configure("warning", "json", path)
    log = logging.getLogger("contactsense")
    log.info("not worth it")
    for _ in range(100):
        log.warning("again %d", 1)
    try:
        raise ValueError("broken")
    except ValueError:
        log.exception("with a traceback")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["message"] for line in lines if line["level"] == "warning"].count("again 1") <= 20
    assert "ValueError: broken" in lines[-1]["traceback"]
    for kind in range(300):
        exec(compile(f"\n{kind * chr(10)}log.warning('x' * 50)", "place", "exec"))
    assert path.stat().st_size <= 2000
    assert len(list(tmp_path.iterdir())) <= 1 + logs.FILES


@pytest.mark.usefixtures("_restored")
def test_a_log_file_that_cannot_be_rotated_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in /var/log, where a service may write its own file and nothing else: at 10 MB the log ended."""
    path = tmp_path / "log"
    path.write_text("")

    def refuse(**_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    with pytest.raises(PermissionError, match=r"in which files can be made, .*: Permission denied"):
        logs.configure(path=path)
    logs.configure(path=Path(os.devnull))  # is never rotated


@pytest.mark.usefixtures("_restored")
def test_what_the_log_file_does_not_take_is_one_line_on_stderr(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    logs.configure(path=tmp_path / "log")
    log, full = logging.getLogger("contactsense"), OSError(errno.ENOSPC, "No space left on device")

    def flush(_: object) -> None:
        raise full

    with monkeypatch.context() as disk:
        disk.setattr(logs.LogFile, "flush", flush)
        log.warning("the journal %s", "fails")
    (line,) = capsys.readouterr().err.splitlines()
    assert "WARNING contactsense: the journal fails [not in " in line
    assert line.endswith("log: No space left on device]")
    logs.configure(form="json", path=tmp_path / "json")
    with monkeypatch.context() as disk:
        disk.setattr(logs.LogFile, "flush", flush)
        log.warning("the journal %s", "fails")
    assert json.loads(capsys.readouterr().err)["message"].startswith("the journal fails [not in ")
    logs.configure(path=tmp_path / "log")
    log.warning("there is space again")
    assert "there is space again" in (tmp_path / "log").read_text()


def test_what_was_left_out_is_counted() -> None:
    now = 5.0
    flood = logs.FloodFilter(lambda: now)
    record = logging.LogRecord("a", logging.WARNING, __file__, 1, "full %d", (3,), None)
    passed = [flood.filter(record) for _ in range(50)]
    assert sum(passed) == 20
    later = logging.LogRecord("a", logging.WARNING, __file__, 1, "full %d", (3,), None)
    later.created = record.created - 3600.0  # the host's clock was set back
    now += 11.0
    assert flood.filter(later)
    assert later.getMessage() == "full 3 (30 more like this were left out)"


def test_the_version_is_not_looked_up_at_each_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """It took half a millisecond and some memory each time a folder of packages had changed."""
    service = create_app(Settings()).state.service

    def refuse(name: str) -> None:
        raise AssertionError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", refuse)
    assert service.health().version


def test_an_action_that_failed_is_told_until_an_attempt_succeeds() -> None:
    app = create_app(Settings())
    report = {"started": False, "answer": None, "restored": True, "active": [], "expected": []}
    report["lowered"] = None
    failed = ActionHealth(type="command", state="failing", error="exit status 1")
    works = ActionHealth(type="command", state="ok")
    with serving(app):
        for action, told in (
            (failed, ["action door failed at its latest attempt: exit status 1"]),
            (works, []),
        ):
            actions = {"door": action.model_dump()}
            app.state.service.reactions.handle_report({**report, "actions": actions})
            assert app.state.service._troubles() == told


def test_latched_collisions_and_failures_of_actions_can_be_alerted_on() -> None:
    reactions = ReactionsHealth(latched=2, actions={"lamp": ActionHealth(type="http", started=5, failed=3)})
    health = create_app(Settings()).state.service.health().model_copy(update={"reactions": reactions})
    lines = Metrics(lambda: health).text().decode().splitlines()
    assert "contactsense_collisions_latched 2.0" in lines
    assert 'contactsense_actions_started_total{action="lamp"} 5.0' in lines
    assert 'contactsense_actions_failed_total{action="lamp"} 3.0' in lines
