"""`contactsense bench NAME`: measurements, each printing the numbers that the documentation quotes."""

from service.cli.lazy import LazyGroup

BENCHES = {
    "truth": "service.bench.truth:truth",
    "motion": "service.bench.motion.command:motion",
    "hold": "service.bench.hold.command:hold",
    "calibration": "service.bench.calibration:calibration",
    "several": "service.bench.several.command:several",
    "speed": "service.bench.speed:speed",
    "stream": "service.bench.stream:stream",
    "latency": "service.bench.latency:latency",
    "solvers": "service.bench.solvers.command:solvers",
    "coverage": "service.bench.coverage.command:coverage",
    "recordings": "service.bench.recordings:recordings",
    "geometry": "service.bench.geometry:geometry",
}
"""Name -> where its click command lives."""


bench = LazyGroup(BENCHES, name="bench", help="Measure speed and error.")
