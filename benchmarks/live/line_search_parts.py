"""`python -m contactsense.benchmarks.live.line_search_parts FOLDER`: where the time of `locate` goes if the
line of action is known, and what it would be if the search itself took none.

The parts are timed in compiled loops over many contacts; the fastest of several repetitions counts. The
reference is Pinocchio's RNEA called from Python.
"""

from pathlib import Path
from typing import NamedTuple

import click
import numpy as np

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.static_cases import COLUMNS, Noise, measured, scene_of
from contactsense.benchmarks.accuracy.static_points import StaticPoints, read
from contactsense.benchmarks.live.search_parts import before_the_search, microseconds
from contactsense.benchmarks.live.speed import yardstick
from contactsense.detection.thresholds import Usable
from contactsense.localization.line_of_action_search import search_along_line_of_action
from contactsense.localization.ranking import LINE_OF_ACTION_DEVIATION, place_primitives, with_link_prior
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.explanation import Measured, isolate_links, take_static_sample

CALLS = 2000
"""Number of single calls that are timed."""


class Parts(NamedTuple):
    """Times of one `locate` [us], means over the samples whose line of action is known."""

    noise: Noise
    primitives: float
    """Number of primitives near the line."""
    before: float
    """Kinematics, residuals, link hypotheses."""
    search: float
    """Bounds of all primitives; entry of the line into those near it, posterior modes, accessible share of
    their neighbourhoods."""
    ranking: float
    """The rest of a sample of a batch: "none of these", ranking, the row of numbers."""
    call: float
    """What a single call takes beyond its share of a batch: Python's checks and estimate, the list of
    candidates, branches that the processor does not predict."""
    total: float
    """One call of `locate`."""
    reference: float
    """Pinocchio's RNEA, called from Python."""


@kernel
def _until_ranking(buffers: Buffers, measured: Measured, usable: Usable, count: np.ndarray) -> None:
    """Everything before the ranking, for N samples; fills the number of primitives searched."""
    constants, state = buffer_views(buffers)
    q, torque, base_wrench, link_wrench = measured
    surfaces, candidates = constants.surfaces, state.candidates
    for i in range(q.shape[0]):
        take_static_sample(constants, state, (q[i], torque[i], base_wrench[i], link_wrench[i]), False)
        isolate_links(constants, state, usable[0], usable[1], usable[2], 1.0)
        place_primitives(surfaces, constants.sensors.depth, state.motion, candidates)
        hypotheses = with_link_prior(state.hypotheses, constants.prior, state.surface_cells)
        count[i] = search_along_line_of_action(
            surfaces, constants.deviations, constants.touchable, hypotheses, constants.prior,
            state.search_buffers, candidates,
        )  # fmt: skip


def measure(points: StaticPoints, noise: Noise) -> Parts:
    """The parts for the contacts of one arm whose line of action is known with this noise."""
    localizer = Localizer(scene_of(points, noise, "all"))
    wrench, torque = measured(points, noise, "all")
    assert wrench is not None
    assert torque is not None
    buffers, usable = localizer._buffers.arguments, (True, True, 0)
    every = (points.q, torque, wrench, np.zeros((len(points.q), 0, 6)))
    lever = np.empty(len(points.q))
    before_the_search(buffers, every, usable, lever)
    q, torque, wrench, links = (values[lever < LINE_OF_ACTION_DEVIATION**2] for values in every)
    chosen, count, unused = (q, torque, wrench, links), np.empty(len(q), dtype=np.int64), np.empty(len(q))
    before = microseconds(lambda: before_the_search(buffers, chosen, usable, unused), len(q))
    search = microseconds(lambda: _until_ranking(buffers, chosen, usable, count), len(q))
    batch = microseconds(
        lambda: localizer.locate_batch(q, base_wrench=wrench, joint_torque=torque, external=False, jobs=1),
        len(q),
    )
    rows = np.resize(np.arange(len(q)), CALLS).tolist()

    def one_by_one() -> None:
        for i in rows:
            localizer.locate(q[i], base_wrench=wrench[i], joint_torque=torque[i], external=False)

    total, rnea = microseconds(one_by_one, CALLS), yardstick()
    reference = microseconds(lambda: [rnea() for _ in range(CALLS)], CALLS)
    times = (before, search - before, batch - search, total - batch, total, reference)
    return Parts(noise, float(count.mean()), *times)


HEAD = (
    "noise [N / Nm / Nm]",
    "primitives near the line",
    "before the search",
    "search",
    "ranking",
    "single call",
    "`locate`",
    "the same without search",
)


def table(parts: list[Parts]) -> list[str]:
    """Rows of a Markdown table, times in multiples of the reference."""
    rows = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for p in parts:
        shares = (p.before, p.search, p.ranking, p.call, p.total, p.total - p.search)
        cells = " | ".join(f"{value / p.reference:.1f}" for value in shares)
        rows.append(f"| {p.noise} | {p.primitives:.1f} | {cells} |")
    return rows


@click.command()
@options.truth_folder
@click.option("--robot", default="ur5e", show_default=True, help="Arm of the ground truth.")
def main(folder: Path, robot: str) -> None:
    """Where the time of one `locate` goes if the line of action is known, on the static contacts in FOLDER
    (static_points_ROBOT.npz). Times are multiples of that of Pinocchio's RNEA, called from Python."""
    points = read(folder, robot)
    click.echo("\n".join(table([measure(points, noise) for noise in COLUMNS[:3]])))


if __name__ == "__main__":
    main()
