"""A touch on a link that the scene leaves out is "none of these", and is not blamed on another link."""

from typing import Any

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 300, seed=4)
SENSORS: dict[str, Any] = {  # that tell the links apart
    "base_wrench": WrenchSensor(force_noise=0.002, moment_noise=0.0004),
    "joint_torque": JointTorqueSensor(noise=0.002),
}
KEPT = ("forearm", "wrist_1", "wrist_2", "wrist_3")
WHOLE = Scene(robot=ARM, **SENSORS)
PRUNED = Scene(robot=ARM, touchable=KEPT, **SENSORS)
GIVEN = {"base_wrench": TRUTH.base_wrench, "joint_torque": TRUTH.torque}
ON_KEPT = np.isin(TRUTH.link, [WHOLE.link_names.index(name) for name in KEPT])


@pytest.fixture(scope="module")
def pruned() -> Localizer:
    return Localizer(PRUNED)


def test_touches_on_links_left_out_are_none_of_these(pruned: Localizer) -> None:
    found = pruned.locate_batch(TRUTH.q, **GIVEN)
    assert found.detected.all()
    none = 1.0 - found.link_probability.sum(axis=1)
    assert (~ON_KEPT).sum() > 100
    assert (none[~ON_KEPT] > 0.5).mean() > 0.95
    assert (found.link_probability[~ON_KEPT].max(axis=1) > 0.95).mean() <= 0.03


def test_touches_on_the_other_links_are_found_as_in_the_whole_scene(pruned: Localizer) -> None:
    whole = Localizer(WHOLE).locate_batch(TRUTH.q, **GIVEN)
    found = pruned.locate_batch(TRUTH.q, **GIVEN)
    right = ON_KEPT & (whole.link == TRUTH.link)
    assert right.sum() > 100
    assert (found.link == whole.link)[right].mean() > 0.99


def test_a_scene_that_names_all_links_leaves_nothing_out() -> None:
    whole = Localizer(WHOLE).locate_batch(TRUTH.q, **GIVEN)
    named = Localizer(PRUNED.model_copy(update={"touchable": WHOLE.link_names})).locate_batch(
        TRUTH.q, **GIVEN
    )
    for one, other in zip(whole, named, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_single_measurement_says_so(pruned: Localizer) -> None:
    i = int(np.flatnonzero(~ON_KEPT & (TRUTH.link == 2))[0])
    found = pruned.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
    assert found.status == "ambiguous"
    assert found.other > 0.5
    assert "no single push on a touchable link" in found.reason
