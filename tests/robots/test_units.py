"""Places and angles in other units than m and rad are refused, with what may have been meant."""

import math
import re

import pytest

from contactsense.robots.units import in_metres, within_one_turn


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize(
    ("size", "meant"), [(6.2832, None), (6.29, None), (7.0, "0.1222"), (math.nan, ""), (math.inf, "")]
)
def test_angles_of_more_than_a_turn(sign: float, place: int, size: float, meant: str | None) -> None:
    given = [0.0, 0.0, 0.0]
    given[place] = sign * size
    rpy = (given[0], given[1], given[2])
    if meant is None:
        assert within_one_turn(rpy) == rpy
        return
    with pytest.raises(ValueError, match="in rad, none above one turn") as raised:
        within_one_turn(rpy)
    hint = re.search(r"; if these are degrees: \[(.*)\]", str(raised.value))
    assert (hint is not None) == bool(meant)
    assert hint is None or hint[1].split(", ")[place].lstrip("-") == meant


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize(("size", "meant"), [(5.0, None), (5.1, "0.0051"), (math.nan, ""), (math.inf, "")])
def test_places_beyond_the_arm(sign: float, place: int, size: float, meant: str | None) -> None:
    given = [0.0, 0.0, 0.0]
    given[place] = sign * size
    xyz = (given[0], given[1], given[2])
    if meant is None:
        assert in_metres(xyz) == xyz
        return
    with pytest.raises(ValueError, match="in m, none above 5, got") as raised:
        in_metres(xyz)
    hint = re.search(r"; if these are mm: \[(.*)\]", str(raised.value))
    assert (hint is not None) == bool(meant)
    assert hint is None or hint[1].split(", ")[place].lstrip("-") == meant
