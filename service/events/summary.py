"""Summaries of contacts from onset to release: events with link, point, force, impulse and duration.

Pure functions: estimates in, events out. A contact that resumes is summarized from its onset on. The point
of a contact is the weighted mean of the points on the link over its samples; each weight is the point's
probability divided by the trace of its covariance. The covariance of the mean point is the mean of the
covariances with the same weights: neighbouring samples share filtered noise and the error of the surface
model, so averaging must not reduce it. Peak force and impulse are those of the samples that determine the
force: while the base sensor is missing, the force that joint torques make most probable may be several times
the true one.
"""

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from contactsense.service.events.model import ContactEvent
from contactsense.types import Contact, Estimate, Event

LOST_AFTER = 1.0
"""A contact without estimates for this time has ended, even if no release was reported [s]."""
_MAX_STEP = 0.1
"""Longest gap between samples for which the impulse is integrated [s]."""
_FAR_LESS_CERTAIN = 100.0
"""Ratio of standard deviations above which a sample says nothing about the force beside the others."""


@dataclass
class _Place:
    """Weighted sums over the samples in which one link was a candidate."""

    probability: float = 0.0
    weight: float = 0.0
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    point_base: np.ndarray = field(default_factory=lambda: np.zeros(3))
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, contact: Contact) -> None:
        self.probability += contact.probability
        spread = float(np.trace(contact.covariance))
        if not math.isfinite(spread) or not np.isfinite(contact.point).all():
            return
        weight = contact.probability / max(spread, 1e-12)
        self.weight += weight
        self.point += weight * contact.point
        self.point_base += weight * contact.point_base
        self.covariance += weight * contact.covariance


class _Force:
    """Peak and impulse over the samples that determine the force."""

    def __init__(self) -> None:
        self.peak, self.impulse = 0.0, np.zeros(3)
        self._variance = math.inf
        self._last: tuple[float, np.ndarray] | None = None

    def add(self, t: float, force: np.ndarray, variance: float) -> None:
        if variance > _FAR_LESS_CERTAIN**2 * self._variance or not np.isfinite(force).all():
            return
        if _FAR_LESS_CERTAIN**2 * variance < self._variance:
            self.peak, self.impulse, self._last = 0.0, np.zeros(3), None
        self._variance = min(variance, self._variance)
        self.peak = max(self.peak, float(np.linalg.norm(force)))
        if self._last is not None:
            self.impulse += (t - self._last[0]) * 0.5 * (self._last[1] + force)
        self._last = (t, force)

    def pause(self) -> None:
        """Nothing is known between the sample before and the next one."""
        self._last = None


class _OpenContact:
    """One contact since its onset."""

    def __init__(self, number: int, t: float) -> None:
        self.number, self.begin, self.last = number, t, t
        self.samples = 0
        self.places: dict[str, _Place] = {}
        self.bodies: Counter[str] = Counter()
        self.force = _Force()
        self.best: Contact | None = None

    def add(self, t: float, explanations: list[Contact], variance: float) -> None:
        """Add a sample; `variance`: sum of those of the force's components [N^2]."""
        best = max(explanations, key=lambda contact: contact.probability)
        if self.best is None or not 0.0 < t - self.last <= _MAX_STEP:
            self.force.pause()
        self.force.add(t, best.force_base, variance)
        self.last, self.best = t, best
        self.samples += 1
        self.bodies[best.body] += 1
        for contact in explanations:
            self.places.setdefault(contact.link, _Place()).add(contact)

    def event(self, event: Event, time: str, reason: str = "") -> ContactEvent:
        if not self.places or self.best is None:
            return ContactEvent(
                kind=event.kind, contact=event.contact, t=event.t, time=time, link=event.link,
                mass=event.mass, reason=reason,
            )  # fmt: skip
        link, place = max(self.places.items(), key=lambda item: item[1].probability)
        force = self.best.force_base
        known = place.weight > 0.0
        return ContactEvent(
            kind=event.kind,
            contact=event.contact,
            t=event.t,
            time=time,
            link=link,
            body=self.bodies.most_common(1)[0][0],
            point=(place.point / place.weight).tolist() if known else None,
            point_base=(place.point_base / place.weight).tolist() if known else None,
            force_base=force.tolist(),
            force=float(np.linalg.norm(force)),
            peak_force=self.force.peak,
            impulse=float(np.linalg.norm(self.force.impulse)),
            duration=max(0.0, self.last - self.begin),
            probability=min(1.0, place.probability / self.samples),
            covariance=(place.covariance / place.weight).tolist() if known else None,
            torsion=self.best.torsion,
            mass=event.mass,
            reason=reason,
        )


class ContactSummaries:
    """Accumulates the contacts of one stream."""

    def __init__(self) -> None:
        self._open: dict[int, _OpenContact] = {}
        self._released: _OpenContact | None = None

    def update(self, estimate: Estimate, time: str) -> list[ContactEvent]:
        """Return the events of this estimate, with the summaries of their contacts.

        Args:
            estimate: The next estimate of the stream.
            time: Time on the host's clock, ISO 8601 in UTC, for the events.
        """
        if not estimate.contacts and not estimate.events and not self._open:
            return []
        for event in estimate.events:
            if event.kind == "resume":
                self._resume(event.contact)
        variance = float(np.trace(estimate.covariance[:3, :3]))
        by_number: dict[int, list[Contact]] = {}
        for contact in estimate.contacts:
            by_number.setdefault(contact.id, []).append(contact)
        for number, explanations in by_number.items():
            if number > 0:
                found = self._open.get(number)
                if found is None or estimate.t < found.last:
                    found = self._open[number] = _OpenContact(number, estimate.t)
                found.add(estimate.t, explanations, variance)
        events = [self._event(event, time) for event in estimate.events]
        return events + self._lost(estimate.t, time)

    def _event(self, event: Event, time: str) -> ContactEvent:
        ended = event.kind in ("release", "weight")
        found = self._open.pop(event.contact, None) if ended else self._open.get(event.contact)
        if event.kind == "release":
            self._released = found
        reason = f"the end of the contact was not seen: {event.reason}" if event.reason else ""
        return (found or _OpenContact(event.contact, event.t)).event(event, time, reason)

    def _resume(self, number: int) -> None:
        """Open the contact that was released last again; in the pause there was no force."""
        found, self._released = self._released, None
        if found is not None and found.number == number:
            found.best = None
            self._open[number] = found

    def _lost(self, t: float, time: str) -> list[ContactEvent]:
        gone = [
            number for number, found in self._open.items() if t < found.last or t > found.last + LOST_AFTER
        ]
        return [
            self._open.pop(number).event(
                Event("release", number, t), time, "the contact is no longer estimated; its end was not seen"
            )
            for number in gone
        ]
