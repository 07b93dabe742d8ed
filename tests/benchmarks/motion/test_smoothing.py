"""`contactsense bench smoothing` on ground truth: live answers, the whole contact's, and their limit."""

import json
from typing import Any

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.motion.smoothing import smoothing
from tests.shared import shared


def rows(*options: str) -> dict[str, dict[str, Any]]:
    folder = shared("truth/motion_ur5e.npz").parent
    result = CliRunner().invoke(smoothing, [str(folder), "--robot", "ur5e", *options, "--json"])
    assert result.exit_code == 0, result.output
    return {row["kind"]: row for row in json.loads(result.stdout)["results"]}


@pytest.mark.long
def test_the_whole_contact_is_better_than_its_last_live_answer() -> None:
    found = rows("--level", "2", "--draws", "2")
    every, slide = found["all"], found["slide"]
    assert every["answers"] == 2 * every["contacts"] >= 50
    assert every["kept_live"] <= 0.1 * every["answers"]
    assert every["link_right"]["whole"] >= every["link_right"]["live"] - 0.05
    assert every["end"]["limit"]["median"] < every["end"]["whole"]["median"] < every["end"]["live"]["median"]
    # Both reach the limit of the scene's surface. Live estimates average over holds as well.
    for kind in ("hold", "slide"):
        end = found[kind]["end"]
        assert end["whole"]["median"] < 1.1 * end["surface_limit"]["median"]
        assert end["limit"]["median"] < end["surface_limit"]["median"]
    assert slide["end"]["whole"]["median"] < 0.85 * slide["end"]["live"]["median"]
    assert every["all_samples"]["whole"]["median"] < 0.75 * every["all_samples"]["live"]["median"]
    # Regions hold the truth, and not by being wide.
    assert every["covered_90"] >= 0.85
    assert every["predicted_mm"] < 2.0 * every["end"]["whole"]["median"]
    assert found["two at a time"]["kept_live"] == found["two at a time"]["answers"]


@pytest.mark.long
def test_without_noise_the_limit_is_the_truth() -> None:
    found = rows("--level", "0")
    assert found["all"]["end"]["limit"]["median"] < 0.05
    assert found["slide"]["end"]["limit"]["median"] < 0.2
    # What is left is the distance of the real surface from the primitives.
    assert 0.1 < found["hold"]["end"]["surface_limit"]["median"] < 0.5
    assert found["hold"]["end"]["whole"]["median"] < 1.1 * found["hold"]["end"]["surface_limit"]["median"]


@pytest.mark.long
def test_from_torques_alone_the_whole_contact_names_the_link_more_often() -> None:
    every = rows("--level", "2", "--torques-alone", "--robot", "ur10e", "--draws", "3")["all"]
    assert every["end"]["limit"]["median"] is None
    assert every["kept_live"] < 0.5 * every["answers"]
    # At their end, live answers have averaged over much of the contact, too.
    assert every["link_right"]["whole"] > max(every["link_right"]["live"], 0.85)
    assert every["end"]["whole"]["median"] < every["end"]["live"]["median"]
    assert every["covered_90"] >= 0.8
