"""Settings: where they come from and what they refuse."""

import pickle
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense import Scene
from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.api.variables import misspelled
from contactsense.service.cli.scene_show import show
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions
from tests.service.seven_joints import seven_joints
from tests.service.ur_rtde import ur_rtde_installed


def test_from_the_environment() -> None:
    environment = {
        "CONTACTSENSE_ROBOT": "ur10e",
        "CONTACTSENSE_PORT": "0",
        "CONTACTSENSE_FT_COUNTS": "1000000, 1000000",
        "CONTACTSENSE_SHARED": "not ours",
        "HOME": "/",
    }
    settings = Settings.from_environment(environment)
    assert settings.robot == "ur10e"
    assert settings.port == 0
    assert settings.ft_counts == (1e6, 1e6)


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


def test_a_folder_that_cannot_be_written_to_is_refused_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        settings = Settings.model_validate({"recording": {"folder": folder}})
        with pytest.raises(
            SettingsError, match=r"--recordings: .*file.*: expected a folder that can be writ"
        ):
            settings.listeners()
    settings = Settings.model_validate({"recording": {"folder": tmp_path / "new"}})
    assert len(settings.listeners()) == 1
    assert list((tmp_path / "new").iterdir()) == []


def test_an_unknown_robot_is_told_the_names() -> None:
    with pytest.raises(SettingsError, match=r"unknown robot .ur7.; there are .*ur5e"):
        Settings(robot="ur7").load_scene()


def test_a_missing_scene_file(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.yaml"):
        Settings(scene=tmp_path / "none.yaml").load_scene()


def test_missing_meshes_are_told_at_the_start(tmp_path: Path) -> None:
    """Not by a traceback of each process that loads the scene."""
    pytest.importorskip("trimesh")
    (tmp_path / "scene.yaml").write_text(f"robot: ur5e\ndetail: skin\nmeshes: {tmp_path / 'none'}\n")
    with pytest.raises(SettingsError, match=r"scene\.yaml: meshes: .*none: no such folder of meshes"):
        Settings(scene=tmp_path / "scene.yaml").load_scene()
    shown = CliRunner().invoke(show, [str(tmp_path / "scene.yaml")])
    assert shown.exit_code == 1
    assert "no such folder of meshes" in shown.output


def test_no_robot_no_source() -> None:
    settings = Settings()
    assert settings.open_source(settings.load_scene()) is None


def test_a_base_sensor_must_be_somewhere() -> None:
    settings = Settings(robot_host="192.0.2.1")
    with pytest.raises(SettingsError, match=r"--ft-host.*--ft-fields.*neither"):
        settings.open_source(settings.load_scene())


def test_rtde_has_six_joints(tmp_path: Path) -> None:
    scene = seven_joints(tmp_path)
    with pytest.raises(
        SettingsError, match=r"^--robot-host: expected an arm with 6 joints, .* with 7; .*push"
    ):
        Settings(robot_host="192.0.2.1").open_source(scene)
    with pytest.raises(SettingsError, match=r"got neither"):
        Settings(robot_host="192.0.2.1").open_source(Scene(robot="ur5e"))


@pytest.mark.parametrize("given", [{"ft_host": "192.0.2.2"}, {"ft_fields": "a,b,c,d,e,f"}])
def test_a_sensor_without_a_robot_is_refused(given: dict[str, str]) -> None:
    settings = Settings.model_validate(given)
    with pytest.raises(SettingsError, match=r"^--ft-\w+ is read together with the robot: expected --robot-h"):
        settings.open_source(settings.load_scene())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ft_host": "192.0.2.2"}, "--ft-host"),
        ({"robot_rate": 125.0, "robot_client": "rtde"}, "--robot-client"),
        ({"wrist_fields": "a"}, "CONTACTSENSE_WRIST_FIELDS"),
        ({"constant_readings": True}, "--constant-readings"),
    ],
)
def test_readers_of_a_robot_are_refused_where_a_controller_sends_the_samples(
    given: dict[str, object], said: str
) -> None:
    settings = Settings.model_validate(
        {"controllers": {"source": "push"}, "robot_host": "192.0.2.1", **given}
    )
    with pytest.raises(SettingsError, match=rf"^{said} is for samples that are read from the robot"):
        settings.open_source(settings.load_scene())


def _rules(**robot: object) -> ReactionRules:
    return ReactionRules.model_validate(
        {
            "robot": robot,
            "actions": {"tell": {"type": "registers"}},
            "rules": [{"name": "any", "links": ["any"], "contact": {"force": 10, "actions": ["tell"]}}],
        }
    )


def pushed(**given: object) -> Settings:
    """Settings of a service to which a controller sends the samples."""
    return Settings.model_validate({"controllers": {"source": "push"}, **given})


def test_the_address_of_the_robot_remains_of_use_to_reactions() -> None:
    settings, rules = pushed(robot_host="192.0.2.1", robot_port=30014), _rules()
    settings.check_robot_address(rules)
    assert settings.open_source(settings.load_scene()) is not None
    reactions = Reactions(rules, settings.robot_host, lambda _: True, settings.robot_port)
    assert reactions.rules is not None
    assert reactions.rules.robot.rtde_port == 30014


@pytest.mark.parametrize(
    ("given", "rules", "why"),
    [
        ({"robot_host": "192.0.2.1"}, None, "--robot-host .* as there are no rules"),
        (
            {"robot_host": "192.0.2.1"},
            _rules(host="192.0.2.9"),
            "--robot-host .* as the rules have the robot's address, 192.0.2.9",
        ),
        ({"robot_port": 30014}, _rules(), "--robot-port .* as there is no --robot-host"),
    ],
)
def test_an_address_of_the_robot_without_use_is_refused(
    given: dict[str, object], rules: ReactionRules | None, why: str
) -> None:
    with pytest.raises(SettingsError, match=f"^{why}$"):
        pushed(**given).check_robot_address(rules)
    with pytest.raises(SettingsError, match=r"^--robot-host is for reactions only with --source push"):
        create_app(pushed(robot_host="192.0.2.1"))


def test_a_sensor_that_the_scene_does_not_have_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\n")
    settings = Settings(scene=tmp_path / "scene.yaml", robot_host="192.0.2.1", ft_host="192.0.2.2")
    assert settings.unused(settings.load_scene()) == ("--ft-host is not used: the scene has no base_wrench",)
    assert Settings(robot_host="192.0.2.1", ft_host="192.0.2.2").unused(Settings().load_scene()) == ()


def test_another_robot_than_that_of_the_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    assert Settings(scene=tmp_path / "scene.yaml", robot="ur5e").load_scene().robot.name == "ur5e"
    with pytest.raises(
        SettingsError, match=r"--robot: expected ur5e, the robot of .*scene.yaml.* got 'ur10e'"
    ):
        Settings(scene=tmp_path / "scene.yaml", robot="ur10e").load_scene()


@ur_rtde_installed
def test_a_signal_that_the_client_cannot_read() -> None:
    settings = Settings(robot_host="192.0.2.1", ft_host="192.0.2.2", robot_client="ur_rtde")
    with pytest.raises(SettingsError, match=r"ur_rtde has no getter for actual_current_as_torque"):
        settings.open_source(settings.load_scene())


def test_the_maker_of_the_source_can_be_sent_to_another_process() -> None:
    settings = Settings(robot_host="192.0.2.1", ft_host="192.0.2.2")
    maker = settings.open_source(settings.load_scene())
    assert maker is not None
    assert pickle.loads(pickle.dumps(maker)).keywords == maker.keywords
