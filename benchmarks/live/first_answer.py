"""`python -m benchmarks.live.first_answer`: time from `import contactsense` to the first answer of
`Localizer.locate`, with an empty cache of machine code and with a filled one. Processor time is that of the
first process; the elapsed time shows what a second one, which compiles as well, saves.

`--against FOLDER` measures another checkout of this repository in the same run, of which the times are given
as a ratio: machines differ, and a time alone says little.
"""

import tempfile
from pathlib import Path
from statistics import median

import click

from contactsense.benchmarks.live.checkout import HERE, numbers_printed

PROGRAM = """
import json, time
began, start = time.process_time(), time.perf_counter()
from contactsense import Localizer, Scene
import numpy as np
imported = time.process_time()
localizer = Localizer(Scene(robot="ur5e"))
made = time.process_time()
q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
localizer.locate(q, base_wrench=np.zeros(6), joint_torque=np.zeros(6))
steps = imported - began, made - imported, time.process_time() - made
print(json.dumps([*steps, sum(steps), time.perf_counter() - start]))
"""
ROWS = ("import", "Localizer", "locate", "until the first answer", "until the first answer, elapsed")


@click.command()
@click.option(
    "--against",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Checkout to compare with.",
)
@click.option(
    "--warm",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="Starts with a filled cache; the median counts.",
)
def main(against: Path | None, warm: int) -> None:
    """Measure the first answer of a fresh installation, and of later starts."""
    folders = [HERE] if against is None else [against.resolve(), HERE]
    times = [_times(folder, warm) for folder in folders]
    heads = ["this checkout"] if against is None else [f"{against}", "this checkout", "ratio"]
    click.echo("| time [s] | " + " | ".join(heads) + " |")
    click.echo("|---" * (len(heads) + 1) + "|")
    for k, cache in enumerate(("empty cache", "filled cache")):
        for step, name in enumerate(ROWS):
            values = [row[k][step] for row in times]
            cells = [f"{value:.2f}" for value in values]
            if len(values) > 1:
                cells.append(f"{values[1] / values[0]:.2f}")
            click.echo(f"| {cache}: {name} | " + " | ".join(cells) + " |")


def _times(folder: Path, warm: int) -> tuple[list[float], list[float]]:
    """Times of the rows with an empty cache, and their medians with a filled one [s]."""
    with tempfile.TemporaryDirectory() as cache:
        first = numbers_printed(folder, Path(cache), PROGRAM)
        later = [numbers_printed(folder, Path(cache), PROGRAM) for _ in range(warm)]
    return first, [median(column) for column in zip(*later, strict=True)]


if __name__ == "__main__":
    main()
