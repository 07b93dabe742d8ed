"""Estimates of random pushes from the readings that they cause."""

import numpy as np

from contactsense import Contact, Estimate, Localizer
from contactsense.benchmarks.multi_contact.trials import Push, Trial, Trials


def locate(localizer: Localizer, trial: Trial, pushes: tuple[Push, ...], **options: object) -> Estimate:
    base, torque = trial.measure(pushes)
    return localizer.locate(trial.q, base_wrench=base, joint_torque=torque, **options)  # type: ignore[arg-type]


def single_contact(localizer: Localizer, trial: Trial, push: Push) -> Contact:
    """The correct candidate of a single push, as known contact of the following measurement."""
    found = locate(localizer, trial, (push,)).contacts
    return min(found, key=lambda contact: float(np.linalg.norm(contact.point_base - push.point)))


def trial_and_contact(localizer: Localizer) -> tuple[Trial, Contact]:
    trial = Trials(localizer.scene, seed=15).draw(1, 20.0, "different")
    return trial, single_contact(localizer, trial, trial.pushes[0])
