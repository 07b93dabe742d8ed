"""Wrong arguments of `Localizer.locate` for several contacts are refused, and those of NumPy accepted."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer
from tests.contactsense.multi_contact.measured_trials import locate, trial_and_contact

pytestmark = pytest.mark.slow  # its kernels compile for long


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"contacts": 0}, "contacts: expected 1 to 3, got 0"),
        ({"contacts": 4}, "contacts: expected 1 to 3, got 4"),
        ({"contacts": 2.0}, "contacts: expected 1 to 3, got 2.0"),
        ({"contacts": np.int64(4)}, "contacts: expected 1 to 3, got"),
        ({"contacts": 2, "known": None}, "known: expected a sequence of Contact, got None"),
        ({"contacts": 2, "drift": "1"}, "drift: expected a positive number of N, got '1'"),
        ({"contacts": 2, "drift": -1.0}, "drift: expected a positive number of N, got -1.0"),
        ({"contacts": 2, "known": [1]}, r"known\[0\]: expected a Contact, got 1"),
        ({"contacts": 2, "drift": float("nan")}, "drift: expected a positive number of N, got nan"),
    ],
)
def test_wrong_options_are_refused(ordinary: Localizer, options: dict[str, object], message: str) -> None:
    trial, _ = trial_and_contact(ordinary)
    with pytest.raises(ValueError, match=message):
        locate(ordinary, trial, trial.pushes, **options)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"link_index": 9}, r"known\[0\].link_index: expected 0 to 6, got 9"),
        ({"primitive": 17}, r"known\[0\].primitive: expected 0 to \d on .*, got 17"),
        ({"point_base": np.full(3, np.nan)}, r"known\[0\].point_base: expected finite numbers"),
        ({"torsion": float("nan")}, r"known\[0\].torsion: expected a finite number, got nan"),
        ({"covariance": np.zeros(3)}, r"known\[0\].covariance: expected finite numbers of shape \(3, 3\)"),
        (
            {"covariance": -1e-4 * np.eye(3)},
            r"known\[0\].covariance: expected a symmetric matrix",
        ),
        ({"covariance": np.diag([1e-4, -1e-4, 1e-4])}, r"known\[0\].covariance: expected a symmetric matrix"),
        ({"covariance": 1e-4 * np.tri(3)}, r"known\[0\].covariance: expected a symmetric matrix"),
    ],
)
def test_wrong_known_contacts_are_refused(
    ordinary: Localizer, change: dict[str, object], message: str
) -> None:
    trial, known = trial_and_contact(ordinary)
    with pytest.raises(ValueError, match=message):
        locate(ordinary, trial, trial.pushes, contacts=2, known=[replace(known, **change)])  # type: ignore[arg-type]


def test_numbers_of_numpy_and_a_rounded_covariance_are_accepted(ordinary: Localizer) -> None:
    trial, known = trial_and_contact(ordinary)
    digits = np.array([[float(f"{x:.7g}") for x in row] for row in known.covariance])
    options = {"contacts": np.int64(2), "known": [replace(known, covariance=digits)], "drift": np.float64(1)}
    found = locate(ordinary, trial, trial.pushes, **options)
    assert found.contacts[0].link == known.link


def test_more_known_contacts_than_asked_for_are_refused(ordinary: Localizer) -> None:
    trial, known = trial_and_contact(ordinary)
    with pytest.raises(ValueError, match="known: expected at most 1"):
        locate(ordinary, trial, trial.pushes, contacts=1, known=[known, known])


def test_values_that_are_not_finite_are_refused(ordinary: Localizer) -> None:
    trial, known = trial_and_contact(ordinary)
    with pytest.raises(ValueError, match="base_wrench: expected finite numbers"):
        ordinary.locate(trial.q, base_wrench=np.full(6, np.nan), contacts=2, known=[known])
