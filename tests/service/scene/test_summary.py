"""What a scene is understood to say."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import JointTorqueSensor, LinkWrenchSensor, Scene, WrenchSensor, robots
from contactsense.plausibility.largest_reading import largest_reading_at_rest
from contactsense.robots.robot import NO_MASS
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.sensors.settings import Friction, LinkInertia
from contactsense.service.analysis.assumptions import assumptions
from contactsense.service.drawing.palette import link_colour, rgb
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.picture import draw_scene
from contactsense.service.scene.summary import (
    as_plain,
    link_places,
    link_prior_line,
    prior_of_links,
    scene_warnings,
    summarize,
)
from tests.plain_arm import plain_ur5e
from tests.unknown_limits import without_limits

Q = usual_posture(robots.load("ur5e"))


def _text(scene: Scene) -> str:
    return "\n".join(f"{line.subject} {line.text}" for line in summarize(scene, Q))


def test_errors_of_the_torque_model_are_told_where_they_are_stated() -> None:
    """They decide what is detected: without them, torques of 0.5 Nm appear to be good."""
    sensor = JointTorqueSensor(noise=0.5, model_error=(7.0, 6.0, 5.0, 4.0, 3.0, 2.0))
    scene = Scene(
        robot="ur10e", joint_torque=sensor, wrist_wrench=WrenchSensor(force_noise=5.5), tool=Tool(mass=1.2)
    )
    assert "noise 0.5 Nm; model error 7, 6, 5, 4, 3, 2 Nm" in _text(scene)
    found = assumptions(scene)
    assert "Joint torques: signal actual_current_as_torque, white noise 0.5 Nm, model error " in " ".join(
        found
    )
    assert "wrist_wrench: white noise of 5.5 N and 0.05 Nm per sample." in found
    at_rest = Scene(robot="ur10e", joint_torque=JointTorqueSensor(friction=Friction(rest_error=2.5)))
    assert "noise 1 Nm; friction error at rest 2.5 Nm" in _text(at_rest)
    assert "error" not in " ".join(line.text for line in summarize(Scene(robot="ur10e"), Q)[:8])


def test_rounding_errors_are_no_moment() -> None:
    """A point mass in the origin of the wrist sensor has no moment about it."""
    scene = Scene(robot="ur10e", base_wrench=None, wrist_wrench=WrenchSensor(), tool=Tool(mass=1.2))
    assert re.search(r"in motion up to [\d.]+ N, 0 Nm on one axis", _text(scene))


def test_mounting_and_sensor_are_said_in_words() -> None:
    sensor = WrenchSensor(rpy=(np.pi, 0.0, 0.0), translation=(0.0, 0.0, -0.04), sign="sensor_on_arm")
    text = _text(Scene(robot="ur5e", mounting=(0.0, np.pi / 6, 0.0), base_wrench=sensor))
    assert "base z axis 30.0 deg from the vertical" in text
    assert "x along +x, y along -y, z along -z" in text
    assert "range unknown" in text


def test_the_reading_at_rest_is_that_of_the_sensors_own_frame_and_sign() -> None:
    turned = WrenchSensor(rpy=(0.0, 0.0, np.pi / 2), translation=(0.1, 0.0, 0.0), sign="sensor_on_arm")
    plain = as_plain(Scene(robot="ur5e"), Q)["base_reading_at_rest"]
    reading = as_plain(Scene(robot="ur5e", base_wrench=turned), Q)["base_reading_at_rest"]
    moment = np.array(plain[3:]) - np.cross([0.1, 0.0, 0.0], plain[:3])
    np.testing.assert_allclose(reading[:3], [0.0, 0.0, -plain[2]], atol=1e-9)
    np.testing.assert_allclose(reading[3:], [-moment[1], moment[0], -moment[2]], atol=1e-9)


def test_a_sensor_in_the_arm_reads_the_weight_of_what_it_carries() -> None:
    tool = Tool(name="gripper", mass=1.2, com=(0.01, 0.02, 0.06))
    elbow = LinkWrenchSensor(name="elbow", link="forearm", sign="sensor_on_arm")
    scene = Scene(robot="ur5e", tool=tool, link_wrenches=(elbow,), wrist_wrench=WrenchSensor())
    readings = as_plain(scene, Q)["link_readings_at_rest"]
    flange = link_places(scene, Q)[-1]
    weight = flange[:3, :3].T @ [0.0, 0.0, -1.2 * 9.81]
    np.testing.assert_allclose(readings["wrist_wrench"], [*weight, *np.cross(tool.com, weight)], atol=1e-9)
    carried = sum(link.inertia.mass for link in scene.robot.links[3:]) + 1.2
    forearm = link_places(scene, Q)[3]
    np.testing.assert_allclose(
        readings["link_wrenches.elbow"][:3], forearm[:3, :3].T @ [0.0, 0.0, 9.81 * carried], atol=1e-9
    )
    numbers = ", ".join(f"{value + 0.0:.1f}" for value in np.round(weight, 1))
    assert f"must read force ({numbers}) N" in _text(scene).partition("wrist_wrench")[2]


def test_the_meaning_of_the_torques_is_said_in_words() -> None:
    text = _text(Scene(robot="ur5e"))
    assert (
        "actual_current_as_torque, the motors' torque: gravity, inertia, rotors and friction are in it"
        in text
    )
    fields = tuple(f"output_double_register_{i}" for i in range(6))
    external = _text(
        Scene(robot="ur5e", joint_torque=JointTorqueSensor(signal="external_torque", fields=fields))
    )
    assert "external_torque, the torque of contacts alone; sign by_actuator" in external


def test_absent_parts_are_said_to_be_absent() -> None:
    text = _text(Scene(robot="ur5e", base_wrench=None, touchable=("forearm",)))
    assert "base_wrench none" in text
    assert "touchable forearm; not: base, shoulder, upper_arm, wrist_1, wrist_2, wrist_3" in text


def test_a_pedestal_below_a_link_that_is_not_touchable_is_touchable() -> None:
    """Contacts on it are found, and the prior over links has the base link for it."""
    plate = {"kind": "cylinder", "a": (0, 0, -0.03), "b": (0, 0, 0), "radius_a": 0.1, "radius_b": 0.1}
    body = Body.model_validate(
        {"name": "adapter", "role": "pedestal", "primitives": [plate | {"rounding": 0.003}]}
    )
    assert "touchable forearm, adapter; not: base, shoulder" in _text(
        Scene(robot="ur5e", touchable=("forearm",), bodies=(body,), link_prior="equal")
    )


def test_the_prior_over_links_is_said_in_percent() -> None:
    links = ("forearm", "wrist_3")
    arm = {"robot": plain_ur5e(), "touchable": links}
    assert link_prior_line(Scene(**arm, link_prior="equal")).text == "equal: forearm 50 %, wrist_3 50 %"
    weights = {"forearm": 1.0, "wrist_3": 3.0}
    assert link_prior_line(Scene(**arm, link_prior=weights)).text == "weights: forearm 25 %, wrist_3 75 %"
    by_area = prior_of_links(Scene(**arm))
    assert by_area["forearm"] > 0.8
    assert sum(by_area.values()) == pytest.approx(1.0)


def test_a_range_that_the_arms_own_weight_or_motion_exceeds_is_warned_of() -> None:
    def warnings(*limits: float) -> list[str]:
        return list(scene_warnings(Scene(robot="ur10e", base_wrench=WrenchSensor(range=limits))))

    small = warnings(600.0, 20.0)
    assert [warning.split(" in ")[1][:2] for warning in small] == ["mx", "my", "mz"]
    assert all("got 20 Nm" in warning for warning in small)
    assert ["weight reaches" in warning for warning in small] == [True, True, False]
    in_motion = warnings(400.0, 200.0)
    assert [warning.split(" in ")[1][:2] for warning in in_motion] == ["fz", "mx", "my"]
    assert all("weight and motion reach (full speed within 0.5 s)" in warning for warning in in_motion)
    assert warnings(600.0, 400.0) == []


@pytest.mark.slow
def test_what_the_range_of_each_sensor_must_exceed_is_said_where_none_is_stated() -> None:
    """For those who choose a sensor: a range below what is said is warned of, one above it is not."""
    tool = Tool(mass=1.2, com=(0.0, 0.0, 0.06))
    elbow = LinkWrenchSensor(name="elbow", link="forearm")
    scene = Scene(robot=plain_ur5e(), tool=tool, wrist_wrench=WrenchSensor(), link_wrenches=(elbow,))
    said = re.findall(r"in motion up to (\S+) N, (\S+) Nm on one axis", _text(scene))
    assert len(said) == 3
    for factor, warned in ((0.99, 3), (1.01, 0)):
        ranges = [(factor * float(force), factor * float(moment)) for force, moment in said]
        sensors = ("base_wrench", WrenchSensor()), ("link_wrenches", elbow), ("wrist_wrench", WrenchSensor())
        update = {
            field: sensor.model_copy(update={"range": limits})
            for (field, sensor), limits in zip(sensors, ranges, strict=True)
        }
        ranged = scene.model_copy(update={**update, "link_wrenches": (update["link_wrenches"],)})
        fields = {text.split(".range")[0] for text in scene_warnings(ranged) if ".range: " in text}
        assert len(fields) == warned


def test_nothing_follows_from_speeds_that_are_not_known() -> None:
    torque = JointTorqueSensor(friction=Friction(viscous=1.0), rotor_inertia=(1.0,) * 6)
    base = WrenchSensor(range=(2000.0, 1000.0))
    scene = Scene(robot=without_limits(plain_ur5e()), joint_torque=torque, base_wrench=base)
    assert "in motion not known: the arm's description has no largest speed of shoulder_pan" in _text(scene)
    assert as_plain(scene, Q)["largest_base_reading_in_motion"] is None
    assert scene_warnings(scene) == ()
    # The weight alone is told as before.
    weak = scene.model_copy(update={"base_wrench": WrenchSensor(range=(100.0, 1000.0))})
    assert "weight reaches, got 100 N" in scene_warnings(weak)[0]


def test_a_wrist_range_that_the_tool_exceeds_is_warned_of() -> None:
    def warnings(*limits: float) -> list[str]:
        tool = Tool(mass=1.2, com=(0.0, 0.0, 0.06))
        scene = Scene(robot="ur10e", tool=tool, wrist_wrench=WrenchSensor(range=limits))
        return [text for text in scene_warnings(scene) if text.startswith("wrist_wrench.range")]

    assert "fz, which the tool's own weight and motion" in warnings(40.0, 10.0)[-1]
    assert warnings(100.0, 10.0) == []


def test_a_range_that_the_load_exceeds_at_rest_is_warned_of_where_speeds_are_not_known() -> None:
    arm, tool = without_limits(plain_ur5e()), Tool(mass=4.0, com=(0.0, 0.0, 0.1))

    def warnings(wrist: tuple[float, float], elbow: tuple[float, float]) -> list[str]:
        within = LinkWrenchSensor(name="elbow", link="forearm", range=elbow)
        sensors = {"wrist_wrench": WrenchSensor(range=wrist), "link_wrenches": (within,)}
        scene = Scene(robot=arm, tool=tool, **sensors)
        return [text for text in scene_warnings(scene) if ".range: " in text]

    large = (1000.0, 500.0)
    found = warnings((20.0, 1.0), large)
    assert [text.split(" in ")[1][:2] for text in found] == ["fx", "fy", "fz", "mx", "my"]
    assert "expected more than 39.2 N in fx, which the tool's own weight reaches, got 20 N" in found[0]
    # 4 kg at 0.1 m, however the sensor is turned.
    assert "expected more than 3.92 Nm in mx" in found[3]
    assert warnings((39.3, 3.93), large) == []
    assert "link_wrenches.elbow.range: expected more than" in warnings(large, (40.0, 500.0))[0]


def test_the_largest_load_is_that_of_an_arm_stretched_out() -> None:
    """Straight and horizontal, every link is as far from the base axis as it gets."""
    scene = Scene(robot="ur10e")
    weight = ArmWeight(scene)
    stretched = max(
        float(np.linalg.norm(weight.wrench(np.array([0.0, 0.0, 0.0, wrist, 0.0, 0.0]))[3:5]))
        for wrist in np.linspace(-np.pi, np.pi, 37)
    )
    largest = largest_reading_at_rest(scene, "base_wrench")
    assert largest[3:5].max() >= 0.995 * stretched
    assert largest[2] == pytest.approx(9.81 * scene.robot.mass)


def test_a_tool_without_a_surface_is_warned_of() -> None:
    assert "tool.primitives" in scene_warnings(Scene(robot="ur5e", tool=Tool(mass=1.0)))[0]


def test_links_without_a_surface_are_warned_of_where_they_may_be_touched() -> None:
    arm = plain_ur5e()
    bare = replace(arm, links=(*arm.links[:3], replace(arm.links[3], primitives=()), *arm.links[4:]))
    (found,) = scene_warnings(Scene(robot=bare))
    assert found == "robot: forearm: no surface; contacts on it cannot be found"
    assert scene_warnings(Scene(robot=bare, touchable=("upper_arm", "wrist_1"))) == ()


def test_moving_links_without_a_mass_are_warned_of() -> None:
    """Many URDFs have no masses. Torques that the controller has compensated need none."""
    arm = plain_ur5e()
    light = replace(
        arm, links=tuple(replace(link, inertia=NO_MASS) for link in arm.links[:2]) + arm.links[2:]
    )
    assert scene_warnings(Scene(robot=arm)) == ()
    (found,) = scene_warnings(Scene(robot=light))
    assert found.startswith("robot: expected the mass of each moving link, got 0 kg for shoulder; ")
    torques = JointTorqueSensor(meaning="external")
    assert scene_warnings(Scene(robot=light, base_wrench=None, joint_torque=torques)) == ()
    own = {"shoulder": LinkInertia(mass=3.0, com=(0.0, 0.0, 0.0), tensor=(0.0,) * 6)}
    assert scene_warnings(Scene(robot=light, inertia=own)) == ()


def test_the_picture_shows_links_in_their_colours(tmp_path: Path) -> None:
    from matplotlib import image

    path = tmp_path / "scene.png"
    draw_scene(Scene(robot=plain_ur5e(), mounting="ceiling", touchable=("forearm",)), Q, path)
    picture = image.imread(path)[..., :3]
    drawn = picture[(picture.min(axis=2) < 0.97)]

    def shades(link: str) -> int:
        """Number of pixels in the colour of a link, lit or in shade."""
        colour = np.array(rgb(link_colour(plain_ur5e().link_names.index(link)))) / 255.0
        light = drawn @ colour / (colour @ colour)
        return int((np.linalg.norm(drawn - light[:, None] * colour, axis=1) < 0.02).sum())

    assert shades("forearm") > 5000
    assert shades("upper_arm") < 0.2 * shades("forearm")
