"""`contactsense bench NAME`: measurements, each printing the numbers that the documentation quotes."""

from contactsense.service.cli.lazy import LazyGroup

BENCHES = {
    "truth": "contactsense.benchmarks.accuracy.truth:truth",
    "motion": "contactsense.benchmarks.motion.command:motion",
    "motion-calibration": "contactsense.benchmarks.motion.calibration:motion_calibration",
    "smoothing": "contactsense.benchmarks.motion.smoothing:smoothing",
    "hold": "contactsense.benchmarks.hold.command:hold",
    "calibration": "contactsense.benchmarks.accuracy.calibration:calibration",
    "several": "contactsense.benchmarks.multi_contact.command:several",
    "calibration-several": "contactsense.benchmarks.multi_contact.calibration:calibration_several",
    "speed": "contactsense.benchmarks.live.speed:speed",
    "stream": "contactsense.benchmarks.live.stream:stream",
    "analyze": "contactsense.benchmarks.live.analysis:analyze",
    "fleet": "contactsense.benchmarks.fleet.command:fleet",
    "latency": "contactsense.benchmarks.live.latency:latency",
    "soak": "contactsense.benchmarks.live.soak:soak",
    "solvers": "contactsense.benchmarks.solvers.command:solvers",
    "coverage": "contactsense.benchmarks.calibration.coverage:coverage",
    "setup": "contactsense.benchmarks.calibration.setup:setup",
    "pushes": "contactsense.benchmarks.calibration.pushes:bench_pushes",
    "recordings": "contactsense.benchmarks.calibration.recordings:recordings",
    "touches": "contactsense.benchmarks.calibration.known_touches:touches",
    "geometry": "contactsense.benchmarks.accuracy.geometry:geometry",
    "tilt": "contactsense.benchmarks.accuracy.tilt:tilt",
    "cells": "contactsense.benchmarks.accuracy.cells:cells",
    "franka": "contactsense.benchmarks.franka.command:franka",
    "map": "contactsense.benchmarks.accuracy.surface_map:surface_map",
    "pruning": "contactsense.benchmarks.accuracy.pruning:pruning",
}
"""Name -> import path of its click command."""


bench = LazyGroup(BENCHES, name="bench", help="Measure speed and error.")
