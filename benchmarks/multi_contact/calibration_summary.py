"""Calibration of several contacts in one case: counted verdicts, and their tables."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from contactsense.benchmarks.accuracy.calibration import Share
from contactsense.benchmarks.multi_contact.calibration_verdict import Verdict
from contactsense.benchmarks.static_truth.cases import Noise
from contactsense.benchmarks.statistics.reliability import Reliability, reliability


class Summary(NamedTuple):
    """All verdicts of one case."""

    robot: str
    noise: Noise
    contacts: int
    arriving: str
    samples: int
    """Estimates."""
    counted: float
    """Fraction of them with that number of contacts. Only these are evaluated."""
    answer: Reliability
    earlier: Share
    """Fraction of the contacts before the last whose region contains the truth."""
    last: Share
    """The same of the last contact; of all contacts, if they are located at once."""
    listed: float
    """Mean of the listed probability."""
    median_mm: float
    """Median distance of the contact that is farthest from its truth [mm]."""


def summarize(
    robot: str, noise: Noise, contacts: int, arriving: str, verdicts: Sequence[Verdict | None]
) -> Summary:
    """Count the correct statements."""
    judged = [v for v in verdicts if v is not None]
    stated, right, expected = np.array([v.answer for v in judged]).reshape(-1, 3).T
    regions = np.array([v.in_region for v in judged]).reshape(-1, contacts)
    last = regions if arriving == "at once" else regions[:, -1:]
    earlier = regions[:, : contacts - last.shape[1]]
    return Summary(
        robot=robot,
        noise=noise,
        contacts=contacts,
        arriving=arriving,
        samples=len(verdicts),
        counted=len(judged) / len(verdicts) if verdicts else float("nan"),
        answer=reliability(stated, right > 0.0, expected),
        earlier=Share.of(int(earlier.sum()), earlier.size),
        last=Share.of(int(last.sum()), last.size),
        listed=float(np.mean([v.listed for v in judged])) if judged else float("nan"),
        median_mm=1e3 * float(np.median([v.error for v in judged])) if judged else float("nan"),
    )


def plain(summary: Summary) -> dict[str, Any]:
    """For JSON."""
    plain = summary._asdict() | {
        "noise": summary.noise._asdict(),
        "answer": summary.answer.as_json(),
        "earlier": None if np.isnan(summary.earlier.found) else summary.earlier._asdict(),
        "last": summary.last._asdict(),
    }
    if summary.counted == 0.0:
        plain |= dict.fromkeys(("answer", "earlier", "last", "listed", "median_mm"))
    return plain


def print_summary(results: Sequence[Summary], what: str) -> None:
    """Print one row for each case; `what` ends the title."""
    table = Table(
        title=f"calibration, several contacts, {what}",
        caption=(
            "counted: answers with the right number of contacts; of these, answer: calibration error of the "
            "stated probabilities, in brackets what it is if the truths are distributed as stated, on "
            "average and at most in 19 of 20 cases; earlier, last: share of the "
            "truths in the regions of 90 %, with its 95 % interval; listed: sum of the listed probabilities; "
            "median: distance of the contact that is farthest from its truth, mm"
        ),
    )
    for name in ("arm", "noise N / Nm / Nm", "contacts", "arriving"):
        table.add_column(name, no_wrap=name != "contacts")
    for name in ("trials", "counted", "answer", "earlier", "last", "listed", "median"):
        table.add_column(name, justify="right", no_wrap=True)
    for r in results:
        judged = (
            "{:.1f} ({:.1f}, {:.1f}) %".format(*(100.0 * x for x in r.answer[:3])),
            "" if np.isnan(r.earlier.found) else str(r.earlier),
            str(r.last),
            f"{100 * r.listed:.1f} %",
            f"{r.median_mm:.1f}",
        )
        table.add_row(
            r.robot,
            str(r.noise),
            str(r.contacts),
            r.arriving,
            str(r.samples),
            f"{100 * r.counted:.1f} %",
            *(judged if r.counted > 0.0 else ()),
        )
    Console(width=160).print(table)


def print_reliability(results: Sequence[Summary]) -> None:
    """Print the reliability of the answers, by stated probability."""
    table = Table(title="answer: stated -> right in %, and how many, by stated probability")
    for name in ("arm", "noise", "contacts", "arriving"):
        table.add_column(name, no_wrap=True)
    for k in range(10):
        table.add_column(f"{10 * k}-{10 * k + 10}", justify="right")
    for r in results:
        cells = {
            round(10 * entry.low): f"{100 * entry.stated:.0f}->{100 * entry.right:.0f}\n{entry.samples}"
            for entry in r.answer.bins
        }
        table.add_row(
            r.robot,
            f"{r.noise.force:g} N",
            str(r.contacts),
            r.arriving,
            *(cells.get(k, "") for k in range(10)),
        )
    Console(width=168).print(table)
