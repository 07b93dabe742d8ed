"""Files are removed by age, also where the clock that names them is set back."""

from pathlib import Path

from contactsense.service.recordings.writing.oldest_files import OldestFiles


def written(folder: Path, stamp: str) -> Path:
    path = folder / f"clip-{stamp}.parquet"
    path.write_bytes(bytes(100))
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name[5:-8] for path in folder.iterdir())


def test_the_oldest_are_removed_and_files_of_other_kinds_stay(tmp_path: Path) -> None:
    (tmp_path / "samples-00.parquet").write_bytes(bytes(1000))
    files = OldestFiles(tmp_path, "clip", 300)
    removed = [path.name for stamp in "12345" for path in files.remove(written(tmp_path, stamp))]
    assert removed == ["clip-1.parquet", "clip-2.parquet"]
    assert len(list(tmp_path.iterdir())) == 4


def test_after_a_clock_is_set_back_the_newest_files_are_kept(tmp_path: Path) -> None:
    for stamp in ("5", "6"):  # of an earlier run
        written(tmp_path, stamp)
    files = OldestFiles(tmp_path, "clip", 300)
    files.remove(written(tmp_path, "7"))
    for stamp, left in (
        ("1", ["1", "6", "7"]),
        ("2", ["1", "2", "7"]),
        ("3", ["1", "2", "3"]),
        ("4", ["2", "3", "4"]),
        ("9", ["3", "4", "9"]),
    ):
        files.remove(written(tmp_path, stamp))
        assert names(tmp_path) == left


def test_the_file_that_was_just_written_is_kept_after_a_start_with_a_wrong_clock(tmp_path: Path) -> None:
    for stamp in ("5", "6"):
        written(tmp_path, stamp)
    files = OldestFiles(tmp_path, "clip", 50)
    files.remove(written(tmp_path, "1"))
    assert names(tmp_path) == ["1"]


def test_a_file_that_cannot_be_removed_is_told_once_and_not_counted(tmp_path: Path) -> None:
    kept = tmp_path / "clip-1.parquet"
    kept.mkdir()  # no user may unlink it
    warnings: list[str] = []
    files = OldestFiles(tmp_path, "clip", 250, warnings.append)
    removed = [path.name for stamp in "2345" for path in files.remove(written(tmp_path, stamp))]
    assert removed == ["clip-2.parquet", "clip-3.parquet"]
    (warning,) = warnings
    assert warning.startswith(f"{kept} cannot be removed, and is not counted")
