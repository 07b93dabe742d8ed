"""A batch on several threads: the same answers, whatever their number."""

from collections.abc import Callable

import numpy as np
import pytest

from contactsense import Localizer
from contactsense.runtime.parallel_batch import CHUNK
from tests.plain_arm import contacts, plain_ur5e

TRUTH = contacts(plain_ur5e(), 2 * CHUNK + 7, seed=3)


@pytest.mark.parametrize("jobs", [2, 5, None])
def test_answers_do_not_depend_on_the_number_of_threads(ordinary: Localizer, jobs: int | None) -> None:
    given = {"base_wrench": TRUTH.base_wrench, "joint_torque": TRUTH.torque}
    alone = ordinary.locate_batch(TRUTH.q, **given, jobs=1)
    assert (alone.link >= 0).mean() > 0.9
    for one, other in zip(alone, ordinary.locate_batch(TRUTH.q, **given, jobs=jobs), strict=True):
        np.testing.assert_array_equal(one, other)


def test_an_empty_batch_has_no_answers(ordinary: Localizer) -> None:
    found = ordinary.locate_batch(np.zeros((0, 6)), base_wrench=np.zeros((0, 6)), jobs=4)
    assert found.link.shape == (0,)


def test_an_error_in_one_row_names_it(ordinary: Localizer) -> None:
    wrench = TRUTH.base_wrench.copy()
    wrench[CHUNK + 1, 2] = np.nan
    with pytest.raises(ValueError, match=rf"base_wrench: .* at index \[{CHUNK + 1}, 2\]"):
        ordinary.locate_batch(TRUTH.q, base_wrench=wrench, jobs=2)


@pytest.mark.parametrize("jobs", [0, -1, 1.5, True, "all"])
def test_a_number_of_threads_that_cannot_be(ordinary: Localizer, jobs: object) -> None:
    locate: Callable[..., object] = ordinary.locate_batch
    with pytest.raises(ValueError, match="jobs: expected a whole number from 1 on, or None"):
        locate(TRUTH.q, base_wrench=TRUTH.base_wrench, jobs=jobs)
