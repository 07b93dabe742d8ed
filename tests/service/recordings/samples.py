"""Samples and estimates that tell their number."""

import numpy as np

from contactsense import Estimate, Sample, Scene

SCENE = Scene(robot="ur5e")


def sample(i: int) -> Sample:
    value = np.full(6, float(i))
    return Sample(0.002 * i, value, value, value, value)


def estimate(i: int) -> Estimate:
    return Estimate(0.002 * i, "none", (), np.zeros(7), np.zeros(6), np.zeros((6, 6)))
