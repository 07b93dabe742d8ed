"""`python -m benchmarks.live.speed_against CHECKOUT`: time per sample, as a ratio to that of another checkout
of this repository in the same run.

Both get the same samples, those of the demo's motion, in processes of their own that take turns: machines
differ and are noisy, and a ratio of what ran side by side says most.
"""

import tempfile
from pathlib import Path
from statistics import median

import click
import numpy as np

from contactsense.benchmarks.live.checkout import HERE, numbers_printed
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate

PROGRAM = """
import json, sys, time
import numpy as np
from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor

clock = time.perf_counter
data = np.load(sys.argv[1])
force, moment, torque = data["noise"]
localizer = Localizer(Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(force_noise=force, moment_noise=moment),
    joint_torque=JointTorqueSensor(noise=torque),
))
t, q, qd, tau, base, touched = (data[name] for name in ("t", "q", "qd", "tau", "base", "touched"))
rows = np.flatnonzero(touched)
large = np.resize(rows, 20_000)
one_core = {"jobs": 1} if "jobs" in localizer.locate_batch.__kwdefaults__ else {}

def batch():
    began = clock()
    localizer.locate_batch(
        q[large], base_wrench=base[large], joint_torque=tau[large], external=False, **one_core
    )
    return (clock() - began) / len(large)

batch()  # loads the kernel
steps = np.full((3, len(t)), np.inf)
locates = np.full((3, len(rows)), np.inf)
batches = []
for k in range(3):
    localizer.reset()
    for i in range(len(t)):
        sample = Sample(float(t[i]), q[i], qd[i], tau[i], base[i])
        began = clock()
        localizer.step(sample)
        steps[k, i] = clock() - began
    for j, i in enumerate(rows):
        position, wrench, torque = q[i], base[i], tau[i]
        began = clock()
        localizer.locate(position, base_wrench=wrench, joint_torque=torque, external=False)
        locates[k, j] = clock() - began
    batches.append(batch())
# The fastest of three repetitions of a sample is what the code needs; the rest is the machine.
step, locate = steps.min(axis=0), locates.min(axis=0)
medians = np.median(step[~touched]), np.median(step[touched]), np.median(locate), min(batches)
print(json.dumps([1e6 * float(value) for value in medians]))
"""
WHAT = ("step without contact", "step in contact", "locate", "locate_batch, one core")


@click.command()
@click.argument("checkout", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--turns", type=click.IntRange(min=1), default=5, show_default=True, help="Runs of each checkout."
)
def main(checkout: Path, turns: int) -> None:
    """Compare the time per sample with that of another CHECKOUT."""
    folders = (checkout.resolve(), HERE)
    motion = simulate(Script.demo())
    times: tuple[list[list[float]], ...] = ([], [])
    with tempfile.TemporaryDirectory() as scratch:
        samples = Path(scratch) / "samples.npz"
        _write(samples, motion)
        for turn in range(turns + 1):
            for folder, rows in zip(folders, times, strict=True):
                cache = Path(scratch) / f"cache{folder == HERE:d}"
                found = numbers_printed(folder, cache, PROGRAM, str(samples))
                if turn > 0:  # The first turn compiles.
                    rows.append(found)
    click.echo(
        f"| median time of a sample [us] | {checkout} | this checkout | ratio | smallest, largest ratio |"
    )
    click.echo("|---" * 5 + "|")
    for k, what in enumerate(WHAT):
        theirs, ours = ([row[k] for row in rows] for rows in times)
        ratios = [b / a for a, b in zip(theirs, ours, strict=True)]
        click.echo(
            f"| {what} | {median(theirs):.2f} | {median(ours):.2f} | {median(ratios):.2f} "
            f"| {min(ratios):.2f}, {max(ratios):.2f} |"
        )


def _write(file: Path, motion: Motion) -> None:
    noise = Script.demo().noise
    touched = np.zeros(len(motion.t), dtype=bool)
    for touch in motion.touches:
        touched[touch.first : touch.last] = True
    np.savez(
        file,
        t=motion.t,
        q=motion.q,
        qd=motion.qd,
        tau=motion.joint_torque,
        base=motion.base_wrench,
        touched=touched,
        noise=[noise.base_force, noise.base_moment, noise.joint_torque],
    )


if __name__ == "__main__":
    main()
