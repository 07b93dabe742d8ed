"""Where the samples come from by the settings."""

import pickle
from pathlib import Path

import pytest

from contactsense import Scene
from contactsense.service.api.app import create_app
from contactsense.service.api.sample_source import check_robot_address, open_source, reader_settings, unused
from contactsense.service.api.scene_file import load_scene
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.controllers.push_source import PushSource
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions
from contactsense.service.sensors.network_wrench import WrenchSource
from tests.service.seven_joints import seven_joints
from tests.service.ur_rtde import ur_rtde_installed


def test_no_robot_no_source() -> None:
    settings = Settings()
    assert open_source(settings, load_scene(settings)) is None


def test_a_base_sensor_must_be_somewhere() -> None:
    settings = Settings(robot_host="192.0.2.1")
    with pytest.raises(SettingsError, match=r"--ft-host.*--ft-fields.*neither"):
        open_source(settings, load_scene(settings))


SIX = ("a", "b", "c", "d", "e", "f")


@pytest.mark.parametrize(
    ("name", "value", "field"),
    [
        ("robot_host", "192.0.2.9", "robot_host"),
        ("robot_port", 30014, "robot_port"),
        ("robot_rate", 125.0, "frequency"),
        ("ft_host", "192.0.2.3", "wrench_host"),
        ("ft_port", 49153, "wrench_port"),
        ("ft_http_port", 8080, "wrench_http_port"),
        ("ft_counts", (1e6, 2e6), "wrench_counts"),
        ("ft_rate", 7000.0, "wrench_rate"),
        ("ft_fields", SIX, "wrench_fields"),
        ("wrist_fields", SIX, "wrist_fields"),
        ("constant_readings", True, "constant_readings"),
    ],
)
def test_what_is_set_reaches_the_reader(name: str, value: object, field: str) -> None:
    usual: dict[str, object] = {"robot_host": "192.0.2.1"}
    if name != "ft_fields":
        usual["ft_host"] = "192.0.2.2"
    plain = reader_settings(Settings.model_validate({**usual, "ft_host": "192.0.2.2"}), Scene(robot="ur5e"))
    found = reader_settings(Settings.model_validate({**usual, name: value}), Scene(robot="ur5e"))
    assert plain is not None
    assert found is not None
    assert getattr(found, field) == value != getattr(plain, field)


def test_the_sources_of_further_sensors_reach_the_reader() -> None:
    sources = {
        "elbow": {"host": "192.0.2.4", "port": 1, "http_port": 2, "counts": [3, 4]},
        "other": {"fields": "a"},
    }
    settings = Settings.model_validate(
        {"robot_host": "192.0.2.1", "ft_host": "192.0.2.2", "link_wrenches": sources}
    )
    elbow = {"name": "elbow", "link": "forearm"}
    scene = Scene.model_validate({"robot": "ur5e", "link_wrenches": [elbow]})
    found = reader_settings(settings, scene)
    assert found is not None
    assert found.link_wrenches == {
        "elbow": WrenchSource("192.0.2.4", 1, 2, (3.0, 4.0)),
        "other": WrenchSource(fields=("a",)),
    }


def test_a_controllers_samples_come_through_its_socket() -> None:
    settings = pushed()
    maker = open_source(settings, load_scene(settings))
    assert maker is not None
    assert (maker.func, maker.keywords) == (PushSource, {"path": settings.controllers.socket_path})  # type: ignore[attr-defined]


def test_rtde_has_six_joints(tmp_path: Path) -> None:
    scene = seven_joints(tmp_path)
    with pytest.raises(
        SettingsError, match=r"^--robot-host: expected an arm with 6 joints, .* with 7; .*push"
    ):
        open_source(Settings(robot_host="192.0.2.1"), scene)
    with pytest.raises(SettingsError, match=r"got neither"):
        open_source(Settings(robot_host="192.0.2.1"), Scene(robot="ur5e"))


@pytest.mark.parametrize("given", [{"ft_host": "192.0.2.2"}, {"ft_fields": "a,b,c,d,e,f"}])
def test_a_sensor_without_a_robot_is_refused(given: dict[str, str]) -> None:
    settings = Settings.model_validate(given)
    with pytest.raises(SettingsError, match=r"^--ft-\w+ is read together with the robot: expected --robot-h"):
        open_source(settings, load_scene(settings))


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
        open_source(settings, load_scene(settings))


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
    check_robot_address(settings, rules)
    assert open_source(settings, load_scene(settings)) is not None
    reactions = Reactions(rules, settings.robot_host, lambda _: True, settings.robot_port)
    assert reactions.rules is not None
    assert reactions.rules.robot.rtde_port == 30014


def test_the_address_of_a_robot_that_is_read_is_of_use_without_rules() -> None:
    check_robot_address(Settings(robot_host="192.0.2.1", robot_port=30014), None)
    check_robot_address(pushed(), None)


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
        check_robot_address(pushed(**given), rules)
    with pytest.raises(SettingsError, match=r"^--robot-host is for reactions only with --source push"):
        create_app(pushed(robot_host="192.0.2.1"))


def test_a_sensor_that_the_scene_does_not_have_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\n")
    settings = Settings(scene=tmp_path / "scene.yaml", robot_host="192.0.2.1", ft_host="192.0.2.2")
    assert unused(settings, load_scene(settings)) == ("--ft-host is not used: the scene has no base_wrench",)
    assert unused(Settings(robot_host="192.0.2.1", ft_host="192.0.2.2"), load_scene(Settings())) == ()


@ur_rtde_installed
def test_a_signal_that_the_client_cannot_read() -> None:
    settings = Settings(robot_host="192.0.2.1", ft_host="192.0.2.2", robot_client="ur_rtde")
    with pytest.raises(SettingsError, match=r"ur_rtde has no getter for actual_current_as_torque"):
        open_source(settings, load_scene(settings))


def test_the_maker_of_the_source_can_be_sent_to_another_process() -> None:
    settings = Settings(robot_host="192.0.2.1", ft_host="192.0.2.2")
    maker = open_source(settings, load_scene(settings))
    assert maker is not None
    assert pickle.loads(pickle.dumps(maker)).keywords == maker.keywords


@pytest.mark.parametrize("name", ["host", "clients"])
def test_an_address_of_ports_that_are_closed_is_told(name: str) -> None:
    def told(**more: object) -> tuple[str, ...]:
        values = {"host": "0.0.0.0", "clients": "192.0.2.7"}
        given = {**values, **more} if more else {name: values[name]}
        settings = Settings.checked({"controllers": given})
        return unused(settings, load_scene(settings))

    assert told() == (f"--controller-{name} is not used: expected --xmlrpc-port or --line-port beside it",)
    assert told(line_port=0) == ()
    assert told(xmlrpc_port=0) == ()
