"""The Panda of the ground truth: an arm with seven joints, whose hand is part of its last link."""

import json
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks import panda
from contactsense.benchmarks.truth import arm as arms
from contactsense.benchmarks.truth.arm import Arm
from contactsense.benchmarks.truth.command import main
from contactsense.service.cli.main import cli

ARRAYS = ("q", "tau", "base_wrench", "link", "c_base", "noise_tau", "noise_wrench", "gravity")


@pytest.fixture(scope="module")
def arm() -> Arm:
    try:
        return arms.read("panda")
    except ImportError as error:
        pytest.skip(str(error))


def test_frames_limits_and_inertia_are_those_of_the_library(arm: Arm) -> None:
    """Both read the same URDF, with code of their own; links that are fixed to the last one are joined."""
    robot = panda.load()
    for link, known in zip(arm.links, robot.links, strict=True):
        assert link.mass == pytest.approx(known.inertia.mass, rel=1e-12)
        np.testing.assert_allclose(link.com, known.inertia.com, atol=1e-12)
        np.testing.assert_allclose(link.tensor, known.inertia.tensor, atol=1e-12)
    for link, joint in zip(arm.links[1:], robot.joints, strict=True):
        np.testing.assert_allclose(link.origin, joint.translation, atol=1e-12)
        np.testing.assert_allclose(link.rotation, joint.rotation, atol=1e-12)
    np.testing.assert_allclose(arm.limits.T, [joint.position_limits for joint in robot.joints], atol=1e-12)
    np.testing.assert_allclose(arm.speeds, [joint.velocity_limit for joint in robot.joints], atol=1e-12)


def test_hand_and_fingers_are_part_of_the_last_link(arm: Arm) -> None:
    """The fingers end 0.112 m beyond the flange, which is 0.107 m from the last joint."""
    last = arm.links[-1]
    assert last.mass == pytest.approx(0.735522 + 0.73 + 2 * 0.015)
    assert last.vertices[:, 2].max() == pytest.approx(0.107 + 0.0584 + 0.0538, abs=0.001)


def test_without_its_package_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "files", absent)
    arms.read.cache_clear()
    done = CliRunner().invoke(main, ["make", "--robot", "panda", "--into", str(tmp_path)])
    arms.read.cache_clear()
    assert done.exit_code == 1
    command = "pip install '.[panda]' in the folder of the sources"
    assert done.output == f"Error: example-robot-data cannot be imported: {command}\n"
    np.savez(tmp_path / "static_points_panda.npz", **dict.fromkeys(ARRAYS, np.zeros(1)))
    done = CliRunner().invoke(cli, ["bench", "truth", str(tmp_path), "--robot", "panda"])
    assert done.exit_code == 1
    assert "the package example-robot-data is not installed: pip install '.[panda]' in" in done.output


@pytest.mark.slow
@pytest.mark.usefixtures("arm")
def test_the_localizer_finds_what_was_made(tmp_path: Path) -> None:
    """Without noise it names 99 % of the links; sixty contacts may miss three by chance, not more."""
    arguments = ("--robot", "panda", "--into", str(tmp_path))
    done = CliRunner().invoke(main, ["make", *arguments, "--suite", "static", "--contacts", "60"])
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["bench", "truth", str(tmp_path), "--robot", "panda", "--json"])
    assert done.exit_code == 0, done.output
    right = [row["link_right"] for row in json.loads(done.stdout)["results"]]
    assert right[0] >= 0.95
    assert right[-1] >= 0.7
