"""Something is mounted on a link, and neither scene nor robot states it."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from contactsense import forward_model
from contactsense.benchmarks.calibration.link_load import with_load
from contactsense.benchmarks.calibration.setup_draws import Case, Settings, right_setup
from contactsense.calibration import FreeMotion
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import LinkInertia
from contactsense.setup_check import check

DRAWN = Settings(seconds=12.0)
PLACE = np.array([-0.15, 0.05, 0.1])


def _loaded(link: str, mass: float, seed: int = 1) -> Case:
    case = right_setup("ur5e", seed, DRAWN)
    return Case(case.scene, with_load(case.scene, case.recording, link, mass, PLACE), None)


@pytest.mark.slow
def test_a_load_on_the_forearm_is_named_with_its_mass_and_place() -> None:
    """The prior of the links' inertia must not absorb it."""
    case = _loaded("forearm", 1.5)
    (item,) = check(case.scene, [case.recording]).wrong
    assert item.line == "inertia.forearm"
    said = re.match(r"a load of about (\S+) kg at (\[.*\]) m in the link's frame", item.remark)
    assert said is not None
    assert float(said[1]) == pytest.approx(1.5, abs=0.4)
    np.testing.assert_allclose(yaml.safe_load(said[2]), PLACE, atol=0.06)


@pytest.mark.long
def test_the_proposed_inertia_cures_the_scene() -> None:
    case = _loaded("forearm", 2.5)
    (item,) = check(case.scene, [case.recording]).wrong
    assert item.proposed is not None
    stated = LinkInertia.model_validate(yaml.safe_load(item.proposed))
    cured = case.scene.model_copy(update={"inertia": {"forearm": stated}})
    assert check(cured, [case.recording]).fits


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mass", "found"), [(1.5, []), pytest.param(4.0, ["inertia.upper_arm"], marks=pytest.mark.long)]
)
def test_a_load_on_the_upper_arm_is_named_if_errors_of_the_inertia_do_not_explain_it(
    mass: float, found: list[str]
) -> None:
    """1.5 kg at its centre of mass change what the motion determines by three standard deviations of the
    prior."""
    case = right_setup("ur5e", 1, DRAWN)
    place = np.array([-0.2125, 0.0, 0.11336])
    loaded = with_load(case.scene, case.recording, "upper_arm", mass, place)
    assert [item.line for item in check(case.scene, [loaded]).wrong] == found


@pytest.mark.slow
def test_the_mass_of_a_link_that_is_a_tenth_off_is_no_load() -> None:
    case = _loaded("forearm", 0.28)
    assert check(case.scene, [case.recording]).fits


@pytest.mark.slow
def test_nothing_is_said_of_the_loads_of_a_right_scene() -> None:
    """This motion does not determine that of the shoulder, nor hardly that of the upper arm."""
    case = right_setup("ur5e", 1, DRAWN)
    found = check(case.scene, [case.recording])
    assert not [item for item in found.findings if item.line.startswith("inertia.")]


@pytest.mark.slow
def test_a_forgotten_tool_beside_a_push_is_no_load_on_the_link_before() -> None:
    """The push fills the residuals: none of them falls by much with either. The tool explains more."""
    case = right_setup("ur5e", 2, DRAWN)
    touched = _pushed(case, "forearm", np.array([20.0, 20.0, 0.0]), 6.0, 8.5)
    assert case.scene.tool is not None
    forgotten = case.scene.model_copy(update={"tool": None})
    (item,) = check(forgotten, [touched]).wrong
    assert item.line == "tool"
    assert item.proposed is not None
    assert float(item.proposed.split()[1].strip(",")) == pytest.approx(case.scene.tool.mass, abs=0.3)


def _pushed(case: Case, link: str, force: np.ndarray, begin: float, end: float) -> FreeMotion:
    """The recording as if a force in base axes [N] had acted on a link."""
    scene, recording = case.scene, case.recording
    assert scene.base_wrench is not None
    assert recording.torque is not None
    assert recording.reading is not None
    torque, wrench = np.zeros_like(recording.torque), np.zeros_like(recording.reading)
    for i in np.flatnonzero((recording.t > begin) & (recording.t < end)):
        read = forward_model(scene, recording.q[i], link, np.array([0.0, 0.05, 0.0]), force)
        torque[i], wrench[i] = read.joint_torque, read.base_wrench
    added = wrench @ WrenchMap.of(scene.base_wrench).to_sensor.T
    return replace(recording, torque=recording.torque + torque, reading=recording.reading + added)
