"""Messages about a recording of a dataset do not contain its path on this computer."""

from pathlib import Path

import pytest

from contactsense.service.analysis.fleet.named_within import named_within

NAME = "robot=a/one"


@pytest.fixture
def given(tmp_path: Path) -> Path:
    """The path of a folder, through a link."""
    (tmp_path / "disk" / "one").mkdir(parents=True)
    (tmp_path / "data").symlink_to(tmp_path / "disk")
    return tmp_path / "data" / "one"


@pytest.mark.parametrize("resolved", [False, True])
def test_the_recording_and_its_files_are_named_within_the_dataset(given: Path, resolved: bool) -> None:
    """An error may have resolved the link, so that its path is another one."""
    path = given.resolve() if resolved else given
    for told in ("{}: expected q", "cannot open '{}'", "{}/part-0.parquet: binary data", "not found: {}."):
        assert named_within(told.format(path), given, NAME) == told.format(NAME)


def test_a_relative_path_is_also_known_by_its_absolute_one(
    given: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(given.parent)
    assert named_within(f"{given.resolve()}: expected q", Path("one"), NAME) == f"{NAME}: expected q"
    assert named_within("another/one: expected q", Path("one"), NAME) == "another/one: expected q"


@pytest.mark.parametrize("end", ["2", ".old", "-b", "_b", "~"])
def test_a_longer_path_with_the_same_beginning_stays(given: Path, end: str) -> None:
    """It is another file, not the recording."""
    told = f"{given}{end}: expected q"
    assert named_within(told, given, NAME) == told


def test_a_name_is_taken_as_it_is(given: Path) -> None:
    assert named_within(f"{given}: bad", given, r"robot=\1") == r"robot=\1: bad"
