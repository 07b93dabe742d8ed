"""Write docs/results.md and docs/further_results.md, with machine and date. Run: make results.

What a command has printed is kept in build/results. A run that was interrupted goes on from there, as long as
neither the commit nor a file outside docs has changed.
"""

import os
import platform
import shlex
import subprocess
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import click

from contactsense.benchmarks.results.kept_output import ROOT, printed_by, source_version
from contactsense.benchmarks.results.plain_table import without_frame
from contactsense.benchmarks.results.sections import DRAW, MAKE, MAKE_PAIRS, PAGES, PICTURE, Page


def _machine() -> str:
    model = platform.processor() or platform.machine()
    cpu = Path("/proc/cpuinfo")
    if cpu.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpu.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    return f"{date.today().isoformat()}, {os.cpu_count()} cores, {model}, Python {platform.python_version()}"


def _lines(page: Page, version: str) -> Iterator[str]:
    yield page.introduction
    yield f"Measured on: {_machine()}.\n"
    notes: set[str] = set()
    for section in page.sections:
        if section.needs is not None and not (ROOT / section.needs).exists():
            continue
        printed = printed_by(section.command, version).strip("\n")
        printed = "\n".join(line.rstrip() for line in printed.splitlines())
        lines = without_frame(printed, notes)
        yield f"## {section.heading}\n"
        if section.about:
            yield f"{section.about}\n"
        yield f"    {section.command}\n"
        yield f"{PICTURE}\n" if section.command == DRAW else f"```\n{lines}\n```\n"


@click.command()
def main() -> None:
    """Make the ground truth, run the commands of all sections, and write the pages of results with what they
    print, machine and date. An interrupted run goes on where it was."""
    for command in (MAKE, MAKE_PAIRS):
        subprocess.run(shlex.split(command), cwd=ROOT, check=True)
    version = source_version(ROOT)
    for page in PAGES:
        (ROOT / "docs" / page.name).write_text("\n".join(_lines(page, version)), encoding="utf-8")


if __name__ == "__main__":
    main()
