"""Recordings as text: what programs and people write into CSV files, and what can be wrong with it."""

import datetime
import io
import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.recordings import RecordingError, read
from contactsense.service.recordings.problem_lines import problem_lines
from tests.service.recordings.recorded_tables import SCENE, N, as_csv, columns, table, text


def test_the_mark_with_which_spreadsheets_begin_a_file_is_no_part_of_a_name(tmp_path: Path) -> None:
    path = as_csv(tmp_path, columns())
    expected = read(path, SCENE).t
    path.write_text("\ufeff" + path.read_text(), encoding="utf-8")
    np.testing.assert_array_equal(read(path, SCENE).t, expected)


@pytest.mark.parametrize("delimiter", [", ", " , ", "\t"])
def test_blanks_around_names_and_numbers_are_no_part_of_them(tmp_path: Path, delimiter: str) -> None:
    found = columns()
    (tmp_path / "a.csv").write_text(text(found, delimiter))
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.q, table(found, "actual_q"))
    assert recording.problems == ()


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_dates_in_text_are_seconds_since_1970(tmp_path: Path, zone: str) -> None:
    found = columns()
    t = 1_774_746_000.0 + np.arange(N) * 0.002
    head, *lines = text(found).splitlines()
    offset = datetime.timezone(datetime.timedelta(hours=2 if zone == "+02:00" else 0))
    dates = [datetime.datetime.fromtimestamp(x, offset).replace(tzinfo=None) for x in t.tolist()]
    dated = [
        f"{date.isoformat(' ', 'microseconds')}{zone},{line.partition(',')[2]}"
        for date, line in zip(dates, lines, strict=True)
    ]
    (tmp_path / "a.csv").write_text("\n".join([head, *dated]))
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_allclose(recording.t, t, atol=1e-6)
    np.testing.assert_array_equal(recording.q, table(found, "actual_q"))
    assert recording.problems == ()


@pytest.mark.parametrize("date", ["01.01.1970", "31.03.2026 12:00:00", "3/31/2026 12:00", "31-03-26"])
def test_dates_of_another_form_are_told_the_one_that_is_read(tmp_path: Path, date: str) -> None:
    head, *lines = text(columns()).splitlines()
    dated = [f"{date},{line.partition(',')[2]}" for line in lines]
    (tmp_path / "a.csv").write_text("\n".join([head, *dated]))
    told = f"timestamp: expected numbers, or dates as 2026-03-31T12:00:00.002, got {date!r}"
    with pytest.raises(RecordingError, match=re.escape(told)):
        read(tmp_path / "a.csv", SCENE)


@pytest.mark.parametrize(
    ("unit", "encoding", "shown"),
    [("rad", "utf-8", "rad"), ("°", "utf-8", "°"), ("°", "latin-1", "\ufffd")],
)
def test_units_below_the_header_are_one_problem(tmp_path: Path, unit: str, encoding: str, shown: str) -> None:
    found = columns()
    head, *lines = text(found).splitlines()
    units = ",".join(["s", *[unit] * (head.count(","))])
    (tmp_path / "a.csv").write_text("\n".join([head, units, *lines]), encoding=encoding)
    recording = read(tmp_path / "a.csv", SCENE)
    assert problem_lines(recording.problems) == (
        f"row 0: expected numbers, got 's', '{shown}', '{shown}', ...; row ignored",
    )
    np.testing.assert_array_equal(recording.q, table(found, "actual_q"))


@pytest.mark.parametrize(
    ("beginning", "told"),
    [
        ("# recorded by me\n", "got a comment: '# recorded by me'"),
        ('[{"timestamp": 0.0, "actual_q_0": 0.0}]\n', "got JSON: "),
        ("#ROSBAG V2.0\n", "got a ROS 1 bag: "),
    ],
)
def test_files_of_another_kind_are_named(tmp_path: Path, beginning: str, told: str) -> None:
    (tmp_path / "a.csv").write_text(beginning + text(columns()))
    with pytest.raises(RecordingError, match=r"a\.csv: expected CSV with a header line .*" + re.escape(told)):
        read(tmp_path / "a.csv", SCENE)


def _savetxt(names: str, delimiter: str, comments: str) -> str:
    stream, found = io.StringIO(), columns()
    head = names.join(found)
    np.savetxt(
        stream, np.column_stack([*found.values()]), header=head, delimiter=delimiter, comments=comments
    )
    return stream.getvalue()


@pytest.mark.parametrize(
    ("names", "delimiter", "comments"),
    [
        *itertools.product([",", " ", ", "], [",", " "], ["# ", "#", "% "]),
        # Without a mark, header and rows have the same delimiter.
        *((delimiter, delimiter, "") for delimiter in (",", " ")),
    ],
)
def test_a_header_as_numpy_writes_it(tmp_path: Path, names: str, delimiter: str, comments: str) -> None:
    (tmp_path / "a.csv").write_text(_savetxt(names, delimiter, comments))
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.q, table(columns(), "actual_q"))
    assert recording.problems == ()


def test_a_missing_number_below_a_commented_header(tmp_path: Path) -> None:
    head, first, *lines = _savetxt(",", ",", "# ").splitlines()
    first = ",".join([*first.split(",")[:-1], "nan"])
    (tmp_path / "a.csv").write_text("\n".join([head, first, *lines]))
    assert len(read(tmp_path / "a.csv", SCENE)) == N


@pytest.mark.parametrize(
    ("separator", "left", "right"),
    [(",", "", ","), (" ", "", " "), ("  ", "", ""), ("   ", "  ", "  "), (",", "\n", "")],
)
def test_what_programs_write_around_numbers(tmp_path: Path, separator: str, left: str, right: str) -> None:
    """A delimiter after each number, columns that are padded with blanks, empty lines."""
    head, *lines = text(columns()).splitlines()
    lines[10] = "1,2"
    rows = [f"{left}{line.replace(',', separator)}{right}" for line in lines]
    (tmp_path / "a.csv").write_text("\n".join([left + head.replace(",", separator), *rows]) + "\n")
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.q, np.delete(table(columns(), "actual_q"), 10, axis=0))
    (problem,) = recording.problems if left != "\n" else recording.problems[-1:]
    assert (problem.row_from, problem.kind) == (10, "bad_row")


def test_columns_without_a_name_are_no_duplicates(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text(columns()).replace("\n", ",,\n"))
    np.testing.assert_array_equal(read(tmp_path / "a.csv", SCENE).q, table(columns(), "actual_q"))


@pytest.mark.parametrize("content", ["", "\n\n"])
def test_an_empty_file_is_told(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(RecordingError, match=r"a\.csv: expected a header line .*, got an empty file$"):
        read(tmp_path / "a.csv", SCENE)


def test_a_title_above_the_header_is_told(tmp_path: Path) -> None:
    title = "robot state" + "," * 24 + "\n"
    (tmp_path / "a.csv").write_text(title + text(columns()))
    with pytest.raises(
        RecordingError, match="expected a header line that names the columns, got 'robot state"
    ):
        read(tmp_path / "a.csv", SCENE)


def test_the_line_with_which_a_spreadsheet_names_the_delimiter(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("sep=;\r\n" + text(columns(), ";").replace("\n", "\r\n"), newline="")
    np.testing.assert_array_equal(read(tmp_path / "a.csv", SCENE).q, table(columns(), "actual_q"))


def test_another_encoding_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text(columns(), "\t"), encoding="utf-16")
    with pytest.raises(RecordingError, match="expected text in UTF-8, got UTF-16"):
        read(tmp_path / "a.csv", SCENE)


def test_words_for_missing_numbers_are_one_problem(tmp_path: Path) -> None:
    head, *lines = text(columns()).splitlines()
    for i, word in enumerate(["NaN", "-nan(ind)", "1.#QNAN", "#N/A", "n/a", "None", "-", ""]):
        lines[i] = ",".join([*lines[i].split(",")[:-1], word])
    (tmp_path / "a.csv").write_text("\n".join([head, *lines]))
    assert problem_lines(read(tmp_path / "a.csv", SCENE).problems) == (
        "rows 0 to 7: base_wrench is missing or not finite",
    )


def test_what_is_no_text_is_not_printed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(np.random.default_rng(0).bytes(4000))
    with pytest.raises(RecordingError, match=r"a\.csv: expected a table as text, got binary data$"):
        read(tmp_path / "a.csv", SCENE)


def test_line_ends_of_old_spreadsheets_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text(columns()).replace("\n", "\r"), newline="")
    with pytest.raises(RecordingError, match="expected lines that end with LF or CR LF, got CR alone"):
        read(tmp_path / "a.csv", SCENE)


def test_zeros_at_the_end_of_a_file_are_not_printed_at_length(tmp_path: Path) -> None:
    """They are left where the power failed while a program wrote: the message had 16 kB."""
    (tmp_path / "a.csv").write_bytes(text(columns()).encode().rstrip() + 4096 * b"\0")
    (line,) = problem_lines(read(tmp_path / "a.csv", SCENE).problems)
    assert line.startswith("row 49: base_wrench_5: expected numbers, got ")
    assert len(line) < 250


@pytest.mark.parametrize("point", [".", ","])
@pytest.mark.parametrize("word", ["", "oops"])
def test_semicolons_and_decimal_commas(tmp_path: Path, point: str, word: str) -> None:
    """As spreadsheets write them; with a word, cells are read as text."""
    found = columns()
    head, first, *lines = text(found, ";").replace(".", point).splitlines()
    if word:
        first = first.rpartition(";")[0] + f";{word}"
    (tmp_path / "a.csv").write_text("\n".join([head.replace("_0;", "_0 ;"), first, *lines]))
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.t, found["timestamp"])
    np.testing.assert_array_equal(recording.q, table(found, "actual_q"))
    assert problem_lines(recording.problems) == (
        (f"row 0: base_wrench_5: expected numbers, got '{word}'",) if word else ()
    )


@pytest.mark.parametrize("delimiter", ["\t", " ", ","])
def test_decimal_commas_between_other_delimiters(tmp_path: Path, delimiter: str) -> None:
    """A table copied out of a spreadsheet; with commas between the columns such numbers are quoted."""
    found = columns()
    head, *lines = text(found, "\t").splitlines()
    rows = [[f'"{cell}"' if delimiter == "," else cell for cell in line.split("\t")] for line in lines]
    rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    (tmp_path / "a.csv").write_text(
        "\n".join([head.replace("\t", delimiter), *(delimiter.join(row) for row in rows)])
    )
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.t, found["timestamp"])
    np.testing.assert_array_equal(recording.q, table(found, "actual_q"))
    assert not recording.problems


@pytest.mark.parametrize(("delimiter", "cell"), [(";", "1.200,5"), (",", '"1,200.5"')])
def test_a_number_with_a_separator_of_thousands_is_shown_as_the_file_has_it(
    tmp_path: Path, delimiter: str, cell: str
) -> None:
    head, first, *lines = text(columns(), delimiter).splitlines()
    first = first.rpartition(delimiter)[0] + delimiter + cell
    (tmp_path / "a.csv").write_text("\n".join([head, first, *lines]))
    shown = cell.strip('"')
    assert problem_lines(read(tmp_path / "a.csv", SCENE).problems) == (
        f"row 0: base_wrench_5: expected numbers, got '{shown}'",
    )


def test_a_missing_number_with_a_decimal_comma(tmp_path: Path) -> None:
    """Windows writes a number that is none as 1.#QNAN, with the decimal mark of the language."""
    head, first, *lines = text(columns(), ";").replace(".", ",").splitlines()
    first = first.rpartition(";")[0] + ";1,#QNAN"
    (tmp_path / "a.csv").write_text("\n".join([head, first, *lines]))
    assert problem_lines(read(tmp_path / "a.csv", SCENE).problems) == (
        "row 0: base_wrench is missing or not finite",
    )


def test_a_header_is_missed_where_commas_are_decimal(tmp_path: Path) -> None:
    lines = text(columns(), ";").replace(".", ",").splitlines()
    (tmp_path / "a.csv").write_text("\n".join(lines[1:]))
    with pytest.raises(
        RecordingError, match=r"expected a header line that names the columns, got '100,000000"
    ):
        read(tmp_path / "a.csv", SCENE)


def test_a_row_with_a_missing_cell_is_ignored_and_a_word_is_no_number(tmp_path: Path) -> None:
    lines = text(columns()).splitlines()
    lines[4] = ",".join(lines[4].split(",")[:-3])
    lines[8] = lines[8].replace(lines[8].split(",")[3], "oops")
    (tmp_path / "a.csv").write_text("\n".join(lines))
    recording = read(tmp_path / "a.csv", SCENE)
    kinds = {problem.kind for problem in recording.problems}
    assert kinds == {"bad_row", "not_finite"}
    assert any("'oops'" in problem.message for problem in recording.problems)
    assert len(recording) == N - 1


def test_a_row_that_is_ignored_may_be_no_utf8(tmp_path: Path) -> None:
    """Such as a comment that an operator has written into the table."""
    lines = text(columns()).splitlines()
    lines[5] = "début du mouvement"
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="latin-1")
    recording = read(tmp_path / "a.csv", SCENE)
    np.testing.assert_array_equal(recording.q, np.delete(table(columns(), "actual_q"), 4, axis=0))
    assert problem_lines(recording.problems) == ("row 4: expected 25 columns, got 1; row ignored",)


def test_words_in_rows_that_follow_each_other_are_one_problem(tmp_path: Path) -> None:
    lines = text(columns()).splitlines()
    for row in (2, 3, 4, 9, 20, 21):
        lines[1 + row] = lines[1 + row].rpartition(",")[0] + ",oops"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    problems = read(tmp_path / "a.csv", SCENE).problems
    rows = [(problem.row_from, problem.row_to) for problem in problems if problem.kind == "bad_row"]
    assert rows == [(2, 5), (9, 10), (20, 22)]


def test_a_word_late_in_a_long_file_does_not_repeat_rows(tmp_path: Path) -> None:
    count = 30_000
    names = [
        "timestamp",
        *(f"{name}_{i}" for name in ("actual_q", "actual_qd", "joint_torque") for i in range(6)),
    ]
    cells = np.round(np.random.default_rng(1).standard_normal((count, 18)), 15)
    rows = [",".join([f"{0.002 * i:.3f}", *map(repr, row)]) for i, row in enumerate(cells.tolist())]
    rows[-5] = rows[-5].rsplit(",", 1)[0] + ",word"
    path = tmp_path / "long.csv"
    path.write_text("\n".join([",".join(names), *rows, ""]))
    # More than one block of the reader.
    assert path.stat().st_size > 1 << 22
    found = read(path, Scene(robot="ur5e", base_wrench=None))
    np.testing.assert_array_equal(found.rows, np.arange(count))
    assert np.flatnonzero(np.isnan(found.joint_torque).any(axis=1)).tolist() == [count - 5]
    assert [problem.row_from for problem in found.problems if problem.kind == "bad_row"] == [count - 5]
