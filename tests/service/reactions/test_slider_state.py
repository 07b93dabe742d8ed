"""What is known of the speed slider, without a controller."""

from typing import Any, cast

import pytest

from contactsense.service.reactions.actions.speed_slider import SLIDER_READING, SpeedSliderAction
from contactsense.service.reactions.lowered_slider import LoweredSlider
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from tests.service.reactions.estimates import contact, estimate


class Slider:
    """A slider that is read, and moved at once."""

    def __init__(self, at: float = 1.0, restore: float | None = 1.0) -> None:
        self.values = {SLIDER_READING: at}
        action = SpeedSliderAction(type="speed_slider", fraction=0.1, restore=restore)
        self.state = LoweredSlider(action, cast(RtdeInputs, self))

    def write(self, _: str, values: tuple[Any, ...]) -> bool:
        """As `RtdeInputs.write`; without the mask the controller ignores the fraction."""
        assert values[0] == 1
        self.values[SLIDER_READING] = values[1]
        return True


def test_what_this_process_has_lowered_counts_more_than_what_another_has_left() -> None:
    slider = Slider()
    slider.state.lower()
    slider.state.write()
    slider.state.take_over(0.3)
    assert slider.state.lowered == 0.1
    assert slider.state.end()
    assert slider.state.write() == 1.0
    assert slider.state.lowered is None


def test_without_restore_nothing_is_to_be_raised_once_the_level_has_ended() -> None:
    slider = Slider(restore=None)
    slider.state.lower()
    slider.state.write()
    slider.state.take_over(0.1)  # what the service has last heard
    assert slider.state.lowered == 0.1
    assert not slider.state.end()
    assert slider.state.lowered is None
    assert slider.state.write() is None
    assert slider.values[SLIDER_READING] == 0.1


@pytest.mark.parametrize(
    ("reads", "after"), [(0.1, 1.0), (0.104, 1.0), (0.096, 1.0), (0.11, 0.11), (0.09, 0.09)]
)
def test_a_slider_that_was_moved_by_one_percent_is_somebody_elses(reads: float, after: float) -> None:
    slider = Slider(reads)
    slider.state.take_over(0.1)
    told = [slider.state.watch(estimate(t), False) for t in (0.0, 0.9, 1.1)]
    assert told[:2] == ["", ""]
    assert told[2].startswith("done: raised" if after == 1.0 else "left at 10 % by")
    assert slider.values[SLIDER_READING] == after
    assert slider.state.lowered is None


@pytest.mark.parametrize(
    ("touched", "active", "restart"), [(True, False, 0.0), (False, True, 0.0), (False, False, 10.0)]
)
def test_a_touch_a_level_and_a_clock_that_is_set_back_begin_the_wait_anew(
    touched: bool, active: bool, restart: float
) -> None:
    slider = Slider(0.1)
    slider.state.take_over(0.1)
    slider.state.watch(estimate(restart), False)
    slider.state.watch(estimate(0.9, *(contact(),) * touched), active)
    for t in (1.1, 1.8):
        assert slider.state.watch(estimate(t), False) == ""
    assert slider.values[SLIDER_READING] == 0.1
    assert slider.state.watch(estimate(2.2), False) != ""


@pytest.mark.parametrize(("left", "read"), [(None, True), (0.1, False)])
def test_nothing_is_raised_that_was_not_left_or_is_not_read(left: float | None, read: bool) -> None:
    slider = Slider(0.1)
    slider.state.take_over(left)
    if not read:
        slider.values.clear()
    assert slider.state.raise_left() == ""
    assert slider.state.lowered == left
    assert slider.values == ({SLIDER_READING: 0.1} if read else {})


def test_without_restore_a_slider_that_another_process_has_left_stays() -> None:
    slider = Slider(0.1, restore=None)
    slider.state.take_over(0.1)
    told = [slider.state.watch(estimate(t), False) for t in (0.0, 1.1)]
    assert told == ["", "left at 10 % by an earlier process, and stays there: no restore is stated"]
    assert slider.values[SLIDER_READING] == 0.1
    assert slider.state.lowered is None
