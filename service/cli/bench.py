"""`contactsense bench NAME`: measurements, each printing the numbers that the documentation quotes."""

from contactsense.service.cli.lazy import LazyGroup

BENCHES = {
    "truth": ("contactsense.benchmarks.accuracy.truth:truth", "Errors on static ground truth."),
    "motion": ("contactsense.benchmarks.motion.command:motion", "Errors on ground truth of moving arms."),
    "motion-calibration": (
        "contactsense.benchmarks.motion.calibration:motion_calibration",
        "Stated probabilities and frequencies, in motion.",
    ),
    "smoothing": (
        "contactsense.benchmarks.motion.smoothing:smoothing",
        "The last live answer and that of the whole contact.",
    ),
    "hold": ("contactsense.benchmarks.hold.command:hold", "A finger held at and slid along a forearm."),
    "calibration": (
        "contactsense.benchmarks.accuracy.calibration:calibration",
        "Stated probabilities and frequencies, at rest.",
    ),
    "several": (
        "contactsense.benchmarks.multi_contact.command:several",
        "Errors for one to three simultaneous contacts.",
    ),
    "calibration-several": (
        "contactsense.benchmarks.multi_contact.calibration:calibration_several",
        "The same probabilities for several contacts.",
    ),
    "speed": ("contactsense.benchmarks.live.speed:speed", "Time per sample."),
    "stream": ("contactsense.benchmarks.live.stream:stream", "Samples lost at 500 Hz."),
    "analyze": ("contactsense.benchmarks.live.analysis:analyze", "Time to analyze recordings at 500 Hz."),
    "fleet": (
        "contactsense.benchmarks.fleet.command:fleet",
        "A simulated year of a fleet, and its analysis.",
    ),
    "latency": (
        "contactsense.benchmarks.live.latency:latency",
        "From a robot's packet to the WebSocket message.",
    ),
    "soak": ("contactsense.benchmarks.live.soak:soak", "Losses and memory with readers that stall."),
    "solvers": ("contactsense.benchmarks.solvers.command:solvers", "Error and time of the contact solvers."),
    "coverage": (
        "contactsense.benchmarks.calibration.coverage:coverage",
        "Whether calibration's 95 % intervals hold.",
    ),
    "setup": (
        "contactsense.benchmarks.calibration.setup:setup",
        "Whether `contactsense check` finds mistakes.",
    ),
    "pushes": (
        "contactsense.benchmarks.calibration.pushes:bench_pushes",
        "Calibration from motion with pushes in it.",
    ),
    "recordings": (
        "contactsense.benchmarks.calibration.recordings:recordings",
        "Residuals of free motion on real recordings.",
    ),
    "touches": (
        "contactsense.benchmarks.calibration.known_touches:touches",
        "Links named for touches added to recordings.",
    ),
    "geometry": (
        "contactsense.benchmarks.accuracy.geometry:geometry",
        "Distance of primitives from the skin.",
    ),
    "tilt": ("contactsense.benchmarks.accuracy.tilt:tilt", "Answers by place and tilt of the force."),
    "cells": ("contactsense.benchmarks.accuracy.cells:cells", "What the sensors of a cell can determine."),
    "franka": (
        "contactsense.benchmarks.franka.command:franka",
        "Links named on a Franka arm, and by a simple rule.",
    ),
    "map": ("contactsense.benchmarks.accuracy.surface_map:surface_map", "Predictions of `contactsense map`."),
    "pruning": ("contactsense.benchmarks.accuracy.pruning:pruning", "Errors with fewer touchable links."),
}
"""Name -> import path of its click command and its line in the help text."""


bench = LazyGroup(BENCHES, name="bench", help="Measure speed and error.")
