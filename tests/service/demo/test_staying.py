"""`contactsense demo --serve` and `--view`: after the comparison the motion repeats, until an interrupt."""

import re
import signal
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.cli.main import cli
from tests.service import http
from tests.service.loopback import until
from tests.service.test_commands import SHORT, contactsense

AWAY = SHORT.replace(
    "dwell: 4.5", "dwell: 4.5, moves: [{to: [1.0, -1.3, 1.6, -1.9, -1.57, 0.0], duration: 2.0}]"
)


@pytest.mark.long
@pytest.mark.realtime
@pytest.mark.parametrize("option", ["--serve", "--view"])
def test_the_arm_is_touched_again_and_again(tmp_path: Path, option: str) -> None:
    script = tmp_path / "Stoß 1.yaml"
    script.write_text(SHORT.replace("PUSH", "push: 25"))
    process = contactsense("demo", option, "--script", str(script))
    assert process.stdout is not None
    told = ""
    while "interface" not in told:
        line = process.stdout.readline()
        assert line, told
        told += line
    assert "is touched once in 4.5 s" in told
    assert "1 of 1 contacts on 1 links found on the right link" in told
    page = re.search(r"Open (http://\S+) in a browser", told)
    assert (page is not None) == (option == "--view")
    if page is not None:
        assert "<html" in http.get(page[1]).text
    latest = re.search(r"latest estimate +(\S+)/contacts", told)
    assert latest is not None

    def again() -> bool:
        events = http.get(f"{latest[1]}/events").json()["events"]
        return sum(event["kind"] == "onset" for event in events) >= 2

    assert until(again, 30.0, step=0.2)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert err == ""


@pytest.mark.parametrize("option", ["--serve", "--view"])
def test_a_motion_that_cannot_repeat_is_refused(tmp_path: Path, option: str) -> None:
    (tmp_path / "away.yaml").write_text(AWAY.replace("PUSH", "push: 25"))
    done = CliRunner().invoke(cli, ["demo", option, "--script", str(tmp_path / "away.yaml")])
    assert done.exit_code == 1
    assert f"{option}: expected a script that ends where it begins" in done.output
    assert done.output.count("\n") == 1


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (
            "watchdog: {variable: input_int_register_47, min_frequency: 10, action: pause}",
            "watchdog: expected none, since ",
        ),
        (
            "obstacles: [{kind: sphere, center: [2, 0, 0], radius: 0.1}]",
            "obstacles: expected none, since ",
        ),
        (
            "safety: {force_limit: 20}",
            "safety.force_limit: expected contacts that do not exceed its 20 N for 0.1 s, got one of 25 N",
        ),
    ],
)
def test_what_changes_the_motion_is_refused(tmp_path: Path, more: str, complaint: str) -> None:
    """The truth beside the estimates is that of the script: a paused arm would be compared with it."""
    (tmp_path / "script.yaml").write_text(AWAY.replace("PUSH", "push: 25") + more + "\n")
    done = CliRunner().invoke(cli, ["demo", "--script", str(tmp_path / "script.yaml")])
    assert done.exit_code == 1
    assert complaint in done.output
    assert "`contactsense mock --script` simulates" in done.output
