"""A contact summed up from onset to release."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Contact, Estimate
from contactsense.service.events.summary import ContactSummaries
from contactsense.types import Event, EventKind

FOREARM = Contact(
    "forearm", 3, 0, 0.8, np.array([0.1, 0.0, 0.0]), np.array([0.5, 0.0, 0.4]), np.array([0.0, 1.0, 0.0]),
    np.array([0.0, -10.0, 0.0]), 0.1, 1e-4 * np.eye(3), id=1,
)  # fmt: skip
WRIST = replace(FOREARM, link="wrist_1", link_index=4, probability=0.2)


def estimate(t: float, *contacts: Contact, event: EventKind | None = None, number: int = 1) -> Estimate:
    events = () if event is None else (Event(event, number, t, contacts[0].link if contacts else ""),)
    return Estimate(
        t, "contact" if contacts else "none", contacts, np.zeros(7), np.zeros(6), np.eye(6), events=events
    )


def pushed(newtons: float) -> Contact:
    return replace(FOREARM, force_base=np.array([0.0, -newtons, 0.0]))


def test_a_contact_from_onset_to_release() -> None:
    summaries = ContactSummaries()
    (onset,) = summaries.update(estimate(0.0, pushed(10.0), WRIST, event="onset"), "now")
    assert (onset.kind, onset.link, onset.force, onset.duration) == ("onset", "forearm", 10.0, 0.0)
    for k in range(1, 101):
        assert not summaries.update(estimate(0.002 * k, pushed(30.0 if k == 50 else 10.0), WRIST), "now")
    (release,) = summaries.update(estimate(0.202, event="release"), "later")
    assert (release.kind, release.contact, release.time) == ("release", 1, "later")
    assert (release.link, release.peak_force) == ("forearm", 30.0)
    assert release.duration == pytest.approx(0.2)
    assert release.impulse == pytest.approx(10.0 * 0.2 + 20.0 * 0.002)
    assert release.probability == pytest.approx(0.8)
    assert release.force_base == [0.0, -10.0, 0.0]
    assert release.torsion == 0.1
    assert not summaries.update(estimate(5.0), "now")


def test_the_link_is_that_of_the_whole_contact() -> None:
    summaries = ContactSummaries()
    likely_wrist = (replace(WRIST, probability=0.9), replace(FOREARM, probability=0.1))
    summaries.update(estimate(0.0, *likely_wrist, event="onset"), "")
    for k in range(10):
        summaries.update(estimate(0.01 * (k + 1), FOREARM, WRIST), "")
    (release,) = summaries.update(estimate(0.2, event="release"), "")
    assert release.link == "forearm"


def test_the_body_is_that_of_most_samples() -> None:
    summaries = ContactSummaries()
    at_table = replace(FOREARM, body="table")
    (onset,) = summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    for k in range(4):
        summaries.update(estimate(0.01 * (k + 1), at_table if k else FOREARM, WRIST), "")
    (hold,) = summaries.update(estimate(0.05, at_table, event="hold"), "")
    (release,) = summaries.update(estimate(0.2, event="release"), "")
    assert (onset.body, hold.body, release.body) == ("", "table", "table")


def test_sharper_samples_count_more() -> None:
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    vague = replace(FOREARM, point=np.array([0.2, 0.0, 0.0]), covariance=9e-4 * np.eye(3))
    summaries.update(estimate(0.002, vague), "")
    nowhere = replace(FOREARM, point=np.array([9.0, 0.0, 0.0]), covariance=np.full((3, 3), np.inf))
    summaries.update(estimate(0.004, nowhere), "")
    (release,) = summaries.update(estimate(0.006, event="release"), "")
    assert release.point == pytest.approx([0.11, 0.0, 0.0])
    assert release.covariance is not None
    assert release.covariance[0][0] == pytest.approx(1.8e-4)  # a typical sample's, not shrunk by averaging


def test_contacts_at_the_same_time_are_kept_apart() -> None:
    summaries = ContactSummaries()
    second = replace(WRIST, id=2, probability=0.95)
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    summaries.update(estimate(0.1, FOREARM, second, event="onset", number=2), "")
    (first,) = summaries.update(estimate(0.2, second, event="release"), "")
    assert (first.contact, first.link, first.duration) == (1, "forearm", 0.1)
    (other,) = summaries.update(estimate(0.3, event="release", number=2), "")
    assert (other.contact, other.link) == (2, "wrist_1")


@pytest.mark.parametrize("t", [2.0, -1.0])
def test_a_contact_that_vanishes_is_released(t: float) -> None:
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    (release,) = summaries.update(estimate(t), "")
    assert (release.kind, release.contact, release.link) == ("release", 1, "forearm")
    assert "no longer estimated" in release.reason


@pytest.mark.parametrize(
    ("reason", "told"),
    [
        ("the clock went back", "the end of the contact was not seen: the clock went back"),
        ("", ""),  # in a degraded estimate, too: other sensors have seen the end
    ],
)
def test_why_the_end_of_a_contact_was_not_seen(reason: str, told: str) -> None:
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    degraded = replace(
        estimate(0.1), status="degraded", reason="base_wrench is missing",
        events=(Event("release", 1, 0.1, reason=reason),),
    )  # fmt: skip
    (release,) = summaries.update(degraded, "")
    assert release.link == "forearm"
    assert release.reason == told


def test_an_event_without_a_known_contact() -> None:
    alone = replace(estimate(1.0), events=(Event("release", 5, 1.0, "forearm"),))
    (release,) = ContactSummaries().update(alone, "now")
    assert (release.kind, release.contact, release.link, release.point) == ("release", 5, "forearm", None)
    assert release.time == "now"


def test_a_contact_that_resumes_in_an_estimate_without_contacts_is_known_but_not_its_force() -> None:
    """As in a degraded one."""
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    summaries.update(estimate(0.1, event="release"), "")
    (resume,) = summaries.update(estimate(0.15, event="resume"), "")
    assert (resume.kind, resume.contact, resume.point) == ("resume", 1, None)
    assert summaries.update(estimate(0.2, FOREARM, event="hold"), "")[0].duration == pytest.approx(0.2)


def test_a_place_about_which_nothing_is_known_is_none() -> None:
    """Where it is known later, that counts."""
    summaries, anywhere = ContactSummaries(), replace(FOREARM, covariance=np.full((3, 3), np.inf))
    (onset,) = summaries.update(estimate(0.0, anywhere, event="onset"), "")
    assert (onset.link, onset.point, onset.point_base, onset.covariance) == ("forearm", None, None, None)
    (hold,) = summaries.update(estimate(0.01, FOREARM, event="hold"), "")
    assert hold.point == pytest.approx([0.1, 0.0, 0.0])
    assert hold.point_base == pytest.approx([0.5, 0.0, 0.4])
    np.testing.assert_allclose(hold.covariance, 1e-4 * np.eye(3))


def test_a_measurement_that_is_no_contact_is_not_summed_up() -> None:
    """Its number is 0."""
    summaries = ContactSummaries()
    assert not summaries.update(estimate(0.0, replace(FOREARM, id=0)), "")
    assert not summaries.update(estimate(5.0), "")


def test_a_contact_that_resumes_is_summed_up_from_its_onset_on() -> None:
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, pushed(30.0), event="onset"), "")
    for k in range(1, 11):
        summaries.update(estimate(0.01 * k, pushed(30.0)), "")
    (first,) = summaries.update(estimate(0.11, event="release"), "")
    assert not summaries.update(estimate(0.14), "")
    (resume,) = summaries.update(estimate(0.15, pushed(10.0), event="resume"), "")
    assert (resume.duration, resume.peak_force) == (0.15, 30.0)
    summaries.update(estimate(0.17, pushed(10.0)), "")
    (release,) = summaries.update(estimate(0.18, event="release"), "")
    assert (first.duration, release.duration) == (0.1, 0.17)
    assert first.impulse == pytest.approx(30.0 * 0.1)
    # In the pause there was no force.
    assert release.impulse == pytest.approx(30.0 * 0.1 + 10.0 * 0.02)
    assert release.peak_force == 30.0


def test_only_the_contact_that_was_released_last_resumes() -> None:
    summaries = ContactSummaries()
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    summaries.update(estimate(0.1, event="release"), "")
    (resume,) = summaries.update(estimate(0.15, replace(FOREARM, id=2), event="resume", number=2), "")
    assert resume.duration == 0.0


def test_a_contact_resumes_though_others_have_had_events_meanwhile() -> None:
    summaries, other = ContactSummaries(), replace(FOREARM, id=2)
    summaries.update(estimate(0.0, FOREARM, event="onset"), "")
    summaries.update(estimate(0.05, FOREARM, other, event="onset", number=2), "")
    summaries.update(estimate(0.1, other, event="release"), "")
    summaries.update(estimate(0.12, other, event="hold", number=2), "")
    (resume,) = summaries.update(estimate(0.15, FOREARM, other, event="resume"), "")
    assert resume.duration == 0.15


@pytest.mark.parametrize("first", [0.0, 0.1])
def test_samples_that_do_not_determine_the_force_count_neither_for_peak_nor_impulse(first: float) -> None:
    summaries = ContactSummaries()
    for k in range(101):
        t = 0.01 * k
        without = first <= t < first + 0.2
        found = estimate(t, pushed(190.0 if without else 10.0), event="onset" if k == 0 else None)
        summaries.update(replace(found, covariance=1e6 * np.eye(6)) if without else found, "")
    (release,) = summaries.update(estimate(1.01, event="release"), "")
    assert release.peak_force == 10.0
    # A gap between two samples that determine it is bridged; before the first one nothing is known.
    assert release.impulse == pytest.approx(10.0 if first else 8.0)
    assert release.duration == pytest.approx(1.0)
