"""Problems of a recording as text: each kind is named once."""

from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.problems import Problem


def test_one_line_for_each_kind_with_count_and_first_rows() -> None:
    message = "base_wrench is missing or not finite"
    missing = [Problem(100 * i, 100 * i + 2, "not_finite", message) for i in range(11)]
    gaps = [Problem(i, i + 1, "gap", f"a gap of {i:.3f} s before this row", i) for i in (7, 9, 8)]
    assert problem_lines([missing[0], gaps[0], *missing[1:], *gaps[1:]]) == (
        "rows 0 to 1, 100 to 101, 200 to 201 and 8 more (11 places): base_wrench is missing or not finite",
        "rows 7, 9, 8 (3 places); the largest, row 9: a gap of 9.000 s before this row",
    )


def test_of_what_has_no_size_the_first_is_an_example() -> None:
    cells = [Problem(i, i + 1, "bad_row", f"q: expected numbers, got '{i}'") for i in (3, 4)]
    assert problem_lines(cells) == ("rows 3, 4 (2 places); the first: q: expected numbers, got '3'",)


def test_held_values_of_a_sensor_are_named_once() -> None:
    held = [Problem(9 * i, 9 * i + 9, "held", f"wrist repeats its values in {i} %", i) for i in (1, 2)]
    other = Problem(0, 9, "held", "base repeats its values in 5 %", 5.0)
    assert problem_lines([*held, other]) == (
        "rows 9 to 17, 18 to 26 (2 places); the largest, rows 18 to 26: wrist repeats its values in 2 %",
        "rows 0 to 8: base repeats its values in 5 %",
    )


def test_rows_in_no_order_are_asked_about() -> None:
    back = [Problem(i, i + 1, "clock_set_back", f"the clock was set back by {i} s", i) for i in (2, 4)]
    assert problem_lines(back) == (
        "rows 2, 4 (2 places); the largest, row 4: the clock was set back by 4 s; are the rows in the order "
        "of time?",
    )
    assert problem_lines(back[:1]) == ("row 2: the clock was set back by 2 s",)


def test_a_single_problem_is_said_as_before() -> None:
    problem = Problem(5, 6, "gap", "a gap")
    assert problem_lines([problem]) == ("row 5: a gap",)


def test_a_bad_cell_is_named_once() -> None:
    missing = Problem(5, 6, "not_finite", "base_wrench is missing or not finite")
    cell = Problem(5, 6, "bad_row", "base_wrench_0: expected numbers, got 'x'")
    assert problem_lines([missing, cell]) == ("row 5: base_wrench_0: expected numbers, got 'x'",)
    # Another signal that is missing in the same row is not hidden.
    other = Problem(5, 6, "not_finite", "joint torques are missing or not finite")
    assert len(problem_lines([missing, other, cell])) == 3
