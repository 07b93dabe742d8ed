"""Sensors between links in requests: their readings reach the localizer, and unknown names are refused."""

import json

import numpy as np
import pytest

from contactsense import LinkWrenchSensor, Localizer, Scene
from contactsense.service.api.http.errors import FieldRefusedError
from contactsense.service.api.messages import LocateOneIn
from contactsense.service.api.routes.locate import _check
from contactsense.service.live.locate_process import StaticSample, _located
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
SCENE = Scene(robot=ARM, base_wrench=None, link_wrenches=[LinkWrenchSensor(name="elbow", link="forearm")])
ZERO = [0.0] * 6


def test_names_are_those_of_the_scene() -> None:
    request = {"q": ZERO, "joint_torque": ZERO}
    _check(LocateOneIn(**request, link_wrenches={"elbow": ZERO}), SCENE, "")
    with pytest.raises(FieldRefusedError, match=r"link_wrenches\.wrist: the scene has no such sensor"):
        _check(LocateOneIn(**request, link_wrenches={"wrist": ZERO}), SCENE, "")
    with pytest.raises(ValueError, match=r"link_wrenches\.elbow"):
        LocateOneIn(**request, link_wrenches={"elbow": [0.0] * 5})


def test_the_answer_is_that_of_the_localizer() -> None:
    truth = contacts(ARM, 20, seed=4)
    i = int(np.flatnonzero(truth.link == 3)[0])
    sample = StaticSample(
        truth.q[i].tolist(), None, truth.torque[i].tolist(), None, {"elbow": truth.base_wrench[i].tolist()}
    )
    answer = json.loads(_located(Localizer(SCENE), sample, True, 1))
    assert answer["contacts"][0]["link"] == "forearm"
    assert np.linalg.norm(np.array(answer["contacts"][0]["point_base"]) - truth.point[i]) < 0.01
