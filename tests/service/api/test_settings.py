"""Settings: where they come from and what they refuse."""

from pathlib import Path

import pytest

from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.api.variables import GROUPED, empty_token, misspelled


def test_from_the_environment() -> None:
    environment = {
        "CONTACTSENSE_ROBOT": "ur10e",
        "CONTACTSENSE_PORT": "0",
        "CONTACTSENSE_FT_COUNTS": "1000000, 1000000",
        "CONTACTSENSE_FT_RATE": "7000",
        "CONTACTSENSE_SHARED": "not ours",
        "HOME": "/",
    }
    settings = Settings.from_environment(environment)
    assert settings.robot == "ur10e"
    assert settings.port == 0
    assert settings.ft_counts == (1e6, 1e6)
    assert settings.ft_rate == 7000.0


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("robot_rate", "inf"),
        ("ft_rate", "nan"),
        ("ft_counts", "inf,1"),
        ("max_request_rate", "inf"),
        ("recording", '{"before": Infinity}'),
    ],
)
def test_numbers_are_finite(setting: str, value: str) -> None:
    with pytest.raises(SettingsError, match=f"^settings: {setting}.*: expected a finite number"):
        Settings.checked({setting: value})


def test_options_of_a_group_are_variables_too(tmp_path: Path) -> None:
    environment = {
        "CONTACTSENSE_CONTROLLERS": '{"tracks": 2, "line_port": 1}',
        "CONTACTSENSE_LINE_PORT": "8002",
        "CONTACTSENSE_SOURCE": "push",
        "CONTACTSENSE_JOURNAL": str(tmp_path / "events.db"),
        "CONTACTSENSE_RECORDINGS": str(tmp_path),
        "CONTACTSENSE_REACTIONS": str(tmp_path / "reactions.yaml"),
    }
    settings = Settings.from_environment(environment)
    controllers = settings.controllers
    assert (controllers.tracks, controllers.line_port, controllers.source) == (2, 8002, "push")
    assert settings.events.path == tmp_path / "events.db"
    assert settings.recording.folder == tmp_path
    assert settings.reactions.file == tmp_path / "reactions.yaml"
    own = Settings.from_environment({"CONTACTSENSE_REACTIONS": '{"file": "other.yaml"}'})
    assert own.reactions.file == Path("other.yaml")


@pytest.mark.parametrize("empty", ["", " "])
def test_an_empty_variable_is_unset(empty: str) -> None:
    names = [*Settings.model_fields, *(name for name, _, _ in GROUPED)]
    environment = {f"CONTACTSENSE_{name.upper()}": empty for name in names}
    settings = Settings.from_environment(environment)
    assert settings.model_dump(exclude_unset=True) == {}
    assert settings == Settings()
    # One that is set counts beside one that is not.
    environment["CONTACTSENSE_EVENTS"] = '{"path": "events.db"}'
    assert Settings.from_environment(environment).events.path == Path("events.db")
    assert empty_token(environment) == ("CONTACTSENSE_TOKEN is empty, which counts as no token",)
    assert empty_token({}) == empty_token({"CONTACTSENSE_TOKEN": "0123456789abcdef"}) == ()


def test_a_misspelled_variable_is_told() -> None:
    environment = {
        "CONTACTSENSE_ROBOT_HOTS": "a",
        "CONTACTSENSE_JOURNL": "b",
        "CONTACTSENSE_SHARED": "not ours",
        "CONTACTSENSE_PORT": "0",
    }
    assert misspelled(environment, Settings.model_fields) == (
        "CONTACTSENSE_ROBOT_HOTS has no effect: there is no such setting (did you mean ROBOT_HOST?)",
        "CONTACTSENSE_JOURNL has no effect: there is no such setting (did you mean JOURNAL?)",
    )


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("PORT", "70000", "^environment: CONTACTSENSE_PORT: expected a number of at most 65535"),
        ("ROBOT_CLIENT", "other", "CONTACTSENSE_ROBOT_CLIENT: expected 'rtde' or 'ur_rtde', got 'other'"),
        ("FT_FIELDS", "a,b", "CONTACTSENSE_FT_FIELDS: expected six names of RTDE fields.* got 'a,b'"),
        ("FT_COUNTS", "5", "CONTACTSENSE_FT_COUNTS: expected two numbers.* 1000000,1000000, got '5'"),
        ("FT_COUNTS", "5,x", "expected two numbers.* got '5,x'"),
        ("FT_COUNTS", "5,-1", "expected two numbers.* got '5,-1'"),
        ("ROBOT_RATE", "1e300", r"CONTACTSENSE_ROBOT_RATE: expected a number of at most 1000, got '1e300'"),
        ("ROBOT_RATE", "0.01", "CONTACTSENSE_ROBOT_RATE: expected a number of at least 1, got '0.01'"),
        *(
            ("RECORDING", f'{{"{field}": 1e9}}', f"CONTACTSENSE_RECORDING.{field}: .* of at most {most}, got")
            for field, most in (("minutes", 1440), ("before", 86400), ("after", 86400))
        ),
        ("LINE_PORT", "x", "CONTACTSENSE_LINE_PORT: expected a whole number, got 'x'"),
        ("EVENTS", '{"path": ', "CONTACTSENSE_EVENTS: expected an object in JSON"),
        (
            "EVENTS",
            '{"path": "a", "path": "b"}',
            "CONTACTSENSE_EVENTS: expected an object .*path: .* got twice",
        ),
        ("EVENTS", '{"pth": "a"}', r"CONTACTSENSE_EVENTS.pth: unknown field \(did you mean path\?\)"),
    ],
)
def test_a_wrong_value_is_named(name: str, value: str, complaint: str) -> None:
    with pytest.raises(SettingsError, match=complaint):
        Settings.from_environment({f"CONTACTSENSE_{name}": value})
