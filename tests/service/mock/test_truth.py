"""The simulated arm's physics against MuJoCo's, where that ground truth is at hand."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import robots
from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics, link_poses

SHARED = Path(os.environ.get("CONTACTSENSE_SHARED", Path(__file__).parents[4] / "shared" / "data"))
CONTACT = ("c_link", "f", "xi", "n_base")


@pytest.mark.parametrize("model", ["ur5e", "ur10e"])
@pytest.mark.parametrize("suite", ["static_points", "motion"])
def test_agrees_with_the_ground_truth_of_another_simulator(suite: str, model: str) -> None:
    path = SHARED / "truth" / f"{suite}_{model}.npz"
    if not path.exists():
        pytest.skip(
            f"no ground truth: {path} is absent; CONTACTSENSE_SHARED names the folder that holds truth/"
        )
    with np.load(path) as file:
        every = slice(None, None, 1 if suite == "static_points" else 20)
        data = {key: file[key][every] for key in ("q", "tau", "base_wrench", "link", *CONTACT)}
        zero = np.zeros_like(data["q"])
        qd, qdd = (file[key][every].astype(float) if key in file else zero for key in ("qd", "qdd"))
        gravity = tuple(file["gravity"])

    loaded = robots.load(model)
    # MuJoCo's torques are those of the transmission: no rotors
    arm = replace(loaded, joints=tuple(replace(joint, rotor_inertia=0.0) for joint in loaded.joints))
    rotations, _ = link_poses(arm, data["q"])
    samples, slots = len(data["q"]), data["link"][0].size
    loads = []
    for slot in range(slots):
        link = data["link"].reshape(samples, slots)[:, slot]
        pick = {key: data[key].reshape(samples, slots, -1)[:, slot].astype(float) for key in CONTACT}
        for index in range(len(arm.links)):
            here = (link == index)[:, None]
            to_link = np.swapaxes(rotations[index], 1, 2)
            force = np.einsum("nij,nj->ni", to_link, pick["f"]) * here
            couple = np.einsum("nij,nj->ni", to_link, pick["xi"] * pick["n_base"]) * here
            loads.append(LinkLoad(index, force, np.cross(pick["c_link"], force) + couple))

    torque, wrench = inverse_dynamics(arm, data["q"], qd, qdd, loads, gravity)
    # inputs are stored in float32 and results rounded to 6e-8 (README of the ground truth)
    np.testing.assert_allclose(torque, data["tau"], rtol=0, atol=2e-6)
    np.testing.assert_allclose(wrench, data["base_wrench"], rtol=0, atol=2e-6)
