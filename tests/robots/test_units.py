"""Places and angles in other units than m and rad are refused, with what may have been meant."""

import math
import re
from collections.abc import Callable

import pytest

from contactsense.robots.units import in_metres, within_one_turn

ANGLES = (within_one_turn, "in rad, none above one turn", "degrees")
PLACES = (in_metres, "in m, none above 5, got", "mm")


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize(
    ("checked", "size", "meant"),
    [
        (ANGLES, 6.2832, None),
        (ANGLES, 6.29, None),
        (ANGLES, 7.0, "0.1222"),
        (ANGLES, math.nan, ""),
        (ANGLES, math.inf, ""),
        (PLACES, 5.0, None),
        (PLACES, 5.1, "0.0051"),
        (PLACES, math.nan, ""),
        (PLACES, math.inf, ""),
    ],
)
def test_values_beyond_what_is_possible(
    sign: float,
    place: int,
    checked: tuple[Callable[..., tuple[float, float, float]], str, str],
    size: float,
    meant: str | None,
) -> None:
    """`meant`: the value by the other unit, none if there is no hint; None: it is accepted."""
    check, message, unit = checked
    given = [0.0, 0.0, 0.0]
    given[place] = sign * size
    values = (given[0], given[1], given[2])
    if meant is None:
        assert check(values) == values
        return
    with pytest.raises(ValueError, match=message) as raised:
        check(values)
    hint = re.search(rf"; if these are {unit}: \[(.*)\]", str(raised.value))
    assert (hint is not None) == bool(meant)
    assert hint is None or hint[1].split(", ")[place].lstrip("-") == meant
