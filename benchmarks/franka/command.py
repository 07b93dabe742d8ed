"""`contactsense bench franka FOLDER`: which link is touched, from the joint torques of a real Panda alone."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest, norm

from contactsense import Localizer, Scene
from contactsense.benchmarks import options, panda
from contactsense.benchmarks.franka.touches import LOADED, Touches, last_joint_above, loaded, read
from contactsense.benchmarks.statistics.reliability import Reliability, reliability
from contactsense.detection.false_alarm_rate import HOUR
from contactsense.scene import LinkPrior

BANDWIDTH = Scene.model_fields["bandwidth"].default
FIXED_THRESHOLD = 0.2
"""Usual threshold of the rule, one for all joints [Nm]."""


class Answers(NamedTuple):
    """Answers for N touches."""

    named: np.ndarray
    """Whether the most probable link is the touched one, shape (N,), bool."""
    listed: np.ndarray
    """Whether some candidate is on the touched link, shape (N,), bool."""
    probability: np.ndarray
    """Probability of the touched link, shape (N,)."""
    stated: np.ndarray
    """Probability of the most probable link, shape (N,)."""
    clear: np.ndarray
    """Whether the estimate is a clear `contact`, not `ambiguous`, shape (N,), bool."""
    fixed: np.ndarray
    """Whether the last joint above `FIXED_THRESHOLD` names the touched link, shape (N,), bool."""
    own: np.ndarray
    """The same with a threshold of its own for each joint, `LOADED` times its drift, shape (N,), bool."""


def answer(touches: Touches, link_prior: LinkPrior = "area") -> Answers:
    """Locate each touch from its torques, with that prior over links, and apply the rule.

    That there is a touch is known, by the same criterion for both: some joint above `LOADED`. The localizer's
    false alarms are those of that criterion, as single measurements.
    """
    joints = touches.q.shape[1]
    false_alarm = 1.0 - (1.0 - 2.0 * norm.sf(LOADED)) ** joints
    decisions_per_hour = HOUR * 2.0 * np.pi * BANDWIDTH
    localizer = Localizer(panda.scene(false_alarm * decisions_per_hour, link_prior))
    estimates = [
        localizer.locate(q, joint_torque=torque) for q, torque in zip(touches.q, touches.torque, strict=True)
    ]
    probabilities = np.array([estimate.link_probability for estimate in estimates])
    link = touches.link
    return Answers(
        named=probabilities.argmax(axis=1) == link,
        listed=np.array(
            [
                any(c.link_index == k for c in estimate.contacts)
                for k, estimate in zip(link, estimates, strict=True)
            ]
        ),
        probability=probabilities[np.arange(len(link)), link],
        stated=probabilities.max(axis=1),
        clear=np.array([estimate.status == "contact" for estimate in estimates]),
        fixed=last_joint_above(touches.torque, FIXED_THRESHOLD) == link,
        own=last_joint_above(touches.in_drifts, LOADED) == link,
    )


def drift_beyond(touches: Touches) -> np.ndarray:
    """RMS of the torques of the joints beyond the touched link, which measure nothing, in units of the stated
    drift, shape (n,); NaN where no such touch exists. About 1 if the drift is as stated."""
    z = touches.in_drifts
    beyond = np.arange(z.shape[1]) >= touches.link[:, None]
    count = beyond.sum(axis=0)
    squares = np.where(beyond, z**2, 0.0).sum(axis=0)
    return np.asarray(np.sqrt(np.divide(squares, count, out=np.full(len(count), np.nan), where=count > 0)))


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@options.link_prior
@options.as_json
def franka(folder: Path, link_prior: LinkPrior, as_json: bool) -> None:
    """Name the touched link of the touches in FOLDER/franka_links.npz, beside the rule "last joint above its
    threshold"."""
    try:
        every = read(folder)
        touches = loaded(every)
        answers = answer(touches, link_prior)
    except FileNotFoundError as error:
        raise click.ClickException(f"{error.filename}: no such recording") from None
    except panda.NoPandaError as error:
        raise click.ClickException(str(error)) from None
    trust = reliability(answers.stated, answers.named)
    beyond = drift_beyond(every)
    if as_json:
        click.echo(json.dumps(_plain(every, touches, answers, trust, beyond), indent=1))
        return
    console = Console(width=110)
    console.print(_table(touches, answers))
    console.print(f"{len(every.link) - len(touches.link)} of {len(every.link)} touches without load left out")
    console.print(
        f"probability of the most probable link: calibration error {100 * trust.error:.1f} %\n"
        f"true probabilities would show {100 * trust.by_chance:.1f} % by chance, "
        f"in 95 % of cases less than {100 * trust.by_chance_95:.1f} %"
    )
    shown = ", ".join("-" if np.isnan(x) else f"{x:.2f}" for x in beyond)
    console.print(f"RMS of the joints beyond the touched link, in stated drifts: {shown}")


def _plain(
    every: Touches, touches: Touches, answers: Answers, trust: Reliability, beyond: np.ndarray
) -> dict[str, Any]:
    return {
        "touches": len(touches.link),
        "left_out": len(every.link) - len(touches.link),
        "link": touches.link.tolist(),
        **{name: value.tolist() for name, value in answers._asdict().items()},
        "calibration": trust.as_json(),
        "drift_beyond": [None if np.isnan(x) else float(x) for x in beyond],
    }


def _table(touches: Touches, answers: Answers) -> Table:
    table = Table(title="Which link is touched, from the joint torques of a Panda alone")
    table.add_column("touched link")
    for column in (
        "touches", "named", "listed", "its probability", "clear", "rule, 0.2 Nm", "rule, own thresholds",
    ):  # fmt: skip
        table.add_column(column, justify="right")
    for link in np.unique(touches.link):
        own = touches.link == link
        table.add_row(f"link {link}", *_cells(Answers(*(part[own] for part in answers))))
    table.add_section()
    table.add_row("all", *_cells(answers))
    parts = (answers.named, answers.listed, None, None, answers.fixed, answers.own)
    counts = (None if part is None else int(part.sum()) for part in parts)
    table.add_row(
        "95 % interval", "", *("" if k is None else _interval(k, len(answers.named)) for k in counts)
    )
    return table


def _cells(answers: Answers) -> list[str]:
    return [
        str(len(answers.named)),
        str(answers.named.sum()),
        str(answers.listed.sum()),
        f"{answers.probability.mean():.2f}",
        str(answers.clear.sum()),
        str(answers.fixed.sum()),
        str(answers.own.sum()),
    ]


def _interval(count: int, total: int) -> str:
    interval = binomtest(count, total).proportion_ci(method="wilson")
    return f"{100 * interval.low:.0f} to {100 * interval.high:.0f} %"
