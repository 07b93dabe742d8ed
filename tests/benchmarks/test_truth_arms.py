"""Which arms' ground truth is read from a folder."""

from pathlib import Path

import click
import pytest

from contactsense.benchmarks.truth_arms import files_of, static_arms


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("static_points_ur10e", "static_points_ur3e", "motion_ur5e", "probe_ur5e", "motion_ur10"):
        (tmp_path / f"{name}.npz").touch()
    return tmp_path


def test_all_arms_of_a_folder_in_the_order_of_their_numbers(folder: Path) -> None:
    assert static_arms(folder, ()) == ["ur3e", "ur10e"]
    assert files_of(folder, (), ("motion", "probe")) == [
        ("ur5e", "motion"),
        ("ur5e", "probe"),
        ("ur10", "motion"),
    ]


def test_chosen_arms_are_read_as_they_are_given(folder: Path) -> None:
    """One that is missing is then told by the reader, which names the file."""
    assert static_arms(folder, ("ur5e", "ur3e")) == ["ur5e", "ur3e"]


def test_a_folder_without_ground_truth_is_named(tmp_path: Path) -> None:
    with pytest.raises(click.ClickException, match=r"expected motion_ROBOT\.npz or probe_ROBOT\.npz"):
        files_of(tmp_path, (), ("motion", "probe"))
