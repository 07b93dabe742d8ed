"""Scripts: what they accept, and what they say when they do not."""

from pathlib import Path

import pytest

from contactsense.service.mock.arm.script import Script, ScriptError

GOOD = """
robot: ur5e
trajectory: {start: [0, 0], dwell: 2.0, moves: [{to: [1, 1], duration: 2.0, dwell: 1.0}]}
contacts:
  - {link: forearm, point: [0, 0, 0.1], normal: [0, 0, 2], push: 20, start: 1.0, duration: 1.0}
"""


def test_a_good_script() -> None:
    script = Script.parse(GOOD)
    assert script.duration == 5.0
    assert script.rate == 500.0
    assert script.contacts[0].push == 20.0


@pytest.mark.parametrize(
    ("old", "new", "complaints"),
    [
        (
            "robot: ur5e",
            "robott: ur5e",
            ["robot: expected a value, the field is missing", "robott: unknown field"],
        ),
        ("push: 20", "push: -20", ["contacts[0].push", "a number above 0", "got -20"]),
        ("push: 20", "push: .nan", ["contacts[0].push", "finite"]),
        ("push: 20", "torsion: 1", ["contacts[0]", "exactly one of push, force_link, force_base", "none"]),
        ("push: 20", "push: 20, force_base: [1, 0, 0]", ["got ['push', 'force_base']"]),
        ("normal: [0, 0, 2], ", "", ["contacts[0]", "normal: expected an outward normal"]),
        ("normal: [0, 0, 2]", "normal: [0, 0, 0]", ["normal: expected a vector of some length"]),
        ("point: [0, 0, 0.1]", "point: [0, 0]", ["contacts[0].point: expected 3 values, got 2"]),
        ("to: [1, 1]", "to: [1]", ["trajectory.moves[0].to: expected 2 joint positions", "got 1"]),
        (
            "start: 1.0, duration: 1.0",
            "start: 4.5, duration: 1.0",
            ["contacts[0]", "within the 5 s", "got 5.5 s"],
        ),
        (
            "robot: ur5e",
            "robot: ur5e\nwatchdog: {variable: input_int_registr_47}",
            [
                "watchdog.variable: expected an RTDE input such as 'input_int_register_47'",
                "input_int_registr_47",
            ],
        ),
        ("push: 20", "push: 1e300", ["contacts[0].push: expected a number of at most 100000, got 1e+300"]),
        *(
            ("to: [1, 1], duration: 2.0", f"to: [1, 1], duration: {number}", [f"moves[0].duration: {told}"])
            for number, told in (
                ("1e300", "expected a number of at most 1000000, got 1e+300"),
                ("1e-300", "expected a number of at least 0.001, got 1e-300"),
            )
        ),
        (
            "robot: ur5e",
            "robot: ur5e\nnoise: {base_force: 1e300}",
            ["noise.base_force: expected a number of at most 10000, got 1e+300"],
        ),
        (
            "robot: ur5e",
            "robot: ur5e\nobstacles: [{kind: sphere, center: [9, 9, 9], radius: 1, stiffness: 1e300}]",
            ["obstacles[0].stiffness: expected a number of at most 1000000000, got 1e+300"],
        ),
        ("robot: ur5e", "robot: ur5e\nrate: 1.0e+9", ["rate: expected a number of at most 10000"]),
        ("robot: ur5e", "robot: ur5e\ngravity: [0, 0, -9810]", ["gravity: expected at most 30 m/s^2, got"]),
        ("duration: 1.0}", "duration: 1.0, ramp: 0.6}", ["ramp: expected at most half", "got 0.6 s"]),
    ],
)
def test_a_wrong_script_names_the_field(old: str, new: str, complaints: list[str]) -> None:
    assert old in GOOD
    with pytest.raises(ScriptError) as error:
        Script.parse(GOOD.replace(old, new), "mine.yaml")
    for complaint in ["mine.yaml", *complaints]:
        assert complaint in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "complaint"), [("- 1", r"expected fields .* got \[1\]"), ("{", "not YAML"), ("", "got nothing")]
)
def test_not_a_script(text: str, complaint: str) -> None:
    with pytest.raises(ScriptError, match=complaint):
        Script.parse(text)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match=r"none\.yaml: cannot read the script: No such file"):
        Script.load(tmp_path / "none.yaml")


def test_the_demo_script_touches_five_links_eight_times() -> None:
    script = Script.demo()
    assert len(script.contacts) == 8
    assert len({contact.link for contact in script.contacts}) == 5
    assert all(15.0 <= (contact.push or 0.0) <= 40.0 for contact in script.contacts)
    assert 20.0 <= script.duration <= 30.0
    noise = script.noise
    assert (noise.base_force, noise.base_moment, noise.joint_torque) == (0.25, 0.05, 1.0)
