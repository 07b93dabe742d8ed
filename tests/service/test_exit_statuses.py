"""Exit statuses of commands: 2 for wrong use of the command line, 1 for input that cannot be used."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.cli.main import cli

PAGE = (Path(__file__).parents[2] / "docs" / "install.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "arguments",
    [
        ["serve", "--port", "99999"],
        ["serve", "--line-port", "99999"],
        ["serve", "--robot-port", "99999"],
        ["serve", "--max-connections", "0"],
        ["serve", "--ft-host", "192.0.2.1"],
        ["serve", "--robot-host", "192.0.2.1"],
        ["serve", "--source", "push", "--ft-host", "192.0.2.1"],
        ["serve", "--host", "0.0.0.0"],
        ["serve", "--tls-key", "key.pem"],
        ["mock", "--rtde-port", "99999"],
        ["view", "--port", "99999"],
        ["view", "--url", "foo"],
        ["record", "--url", "127.0.0.1:8000"],
        ["demo", "--port", "99999"],
        ["record"],
        ["record", "--out", "folder"],
        ["record", "--out", "folder", "--robot-host", "192.0.2.1"],
        ["check", "absent.yaml", "absent.csv"],
        ["check", "absent.yaml"],
    ],
)
def test_wrong_use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 2, result.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["serve", "--scene", "absent.yaml"],
        ["serve", "--reactions", "absent.yaml"],
        ["record", "--out", "folder", "--scene", "absent.yaml"],
        ["scene", "show", "absent.yaml"],
        ["reactions", "check", "absent.yaml"],
        ["map", "absent.yaml", "--posture", "0,-90,90,0,0,0"],
        ["mock", "--scene", "absent.yaml"],
        ["calibrate", "absent.csv", "--scene", "absent.yaml"],
        ["analyze", "absent.csv", "--out", "folder"],
        ["record", "--from", "absent.csv", "--out", "a.csv"],
        ["view", "absent.csv"],
    ],
)
def test_input_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 1, result.output
    assert "absent" in result.output


def test_a_wrong_variable_is_no_wrong_use() -> None:
    result = CliRunner().invoke(cli, ["serve"], env={"CONTACTSENSE_PORT": "99999"})
    assert result.exit_code == 1, result.output
    assert "CONTACTSENSE_PORT" in result.output


def test_the_statuses_are_documented() -> None:
    (section,) = [part for part in PAGE.split("\n## ") if part.startswith("Exit statuses\n")]
    for status in range(4):
        assert f"| {status} |" in section
