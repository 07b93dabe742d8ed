"""Reading the ground truth of moving arms: one stream of samples per run, and its contacts."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import click
import numpy as np

from contactsense.benchmarks.truth_arms import file_of, name_of
from contactsense.service.mock.arm.measured_velocity import measured_velocity

SUITES = ("motion", "probe")
Kind = Literal["standstill", "slow", "fast"]
KINDS: tuple[Kind, ...] = ("standstill", "slow", "fast")
_COMMON = (
    "t", "q", "qd", "tau", "base_wrench", "noise_tau", "noise_wrench", "run", "gravity", "meta", "n_base"
)  # fmt: skip
_OWN = {
    "motion": ("active", "link", "c_base", "f", "xi", "run_kind", "run_multi", "ev_run",
               "ev_slot", "ev_start", "ev_stop", "ev_type"),
    "probe": ("active", "link", "c_base", "f", "m_c", "fn_link", "run_moving", "qdd"),
}  # fmt: skip
EVENT_TYPES = ("hold", "slide", "impact")
_HALF_STEP = 0.25e-3
"""`probe` was integrated by semi-implicit Euler in steps of 0.5 ms: the logged velocity belongs to the middle
of the step before its torques and wrenches. A shift by half a step aligns the two [s]."""


@dataclass(frozen=True)
class Event:
    """One contact: from its first sample to the one after its last, counted from the start of the stream."""

    start: int
    stop: int
    type: str
    """`hold`, `slide`, `impact`, or `press` (a simulated finger)."""


@dataclass(frozen=True)
class Stream:
    """One run of N samples; units and frames as in `contactsense.Sample`, the sensors without noise."""

    robot: str
    gravity: float
    suite: str
    run: int
    kind: Kind
    multi: bool
    """Whether two contacts overlap in this run."""
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    torque: np.ndarray
    base_wrench: np.ndarray
    noise_torque: np.ndarray
    """White noise of unit variance, shape (N, n)."""
    noise_wrench: np.ndarray
    """The same, shape (N, 6)."""
    touched: np.ndarray
    """Whether anything touches, shape (N,)."""
    link: np.ndarray
    """Touched link; -1 where nothing or more than one link is touched, shape (N,)."""
    point_base: np.ndarray
    """Contact point, shape (N, 3) [m]."""
    normal_base: np.ndarray
    """Outward unit normal there, zero without contact, shape (N, 3)."""
    wrench: np.ndarray
    """Wrench of that contact about the base origin, shape (N, 6) [N, Nm]."""
    events: tuple[Event, ...]


def read(folder: Path, robot: str, suite: str) -> list[Stream]:
    """The runs of `SUITE_ROBOT.npz` in `folder`.

    Raises:
        click.ClickException: the file is missing, unreadable or lacks an array; the message names it.
    """
    path = file_of(folder, suite, robot)
    try:
        with np.load(path) as file:
            missing = [name for name in (*_COMMON, *_OWN[suite]) if name not in file]
            if missing:
                raise click.ClickException(
                    f"{path}: expected the array {missing[0]!r}, found {', '.join(file.files)}"
                )
            data = {name: np.asarray(file[name]) for name in (*_COMMON, *_OWN[suite])}
    except (OSError, ValueError) as error:
        raise click.ClickException(f"{path}: cannot read ground truth: {error}") from None
    assert json.loads(str(data["meta"]))["robot"] == name_of(robot)
    return list(_runs(data, robot, suite))


def redrawn(stream: Stream, draw: int) -> Stream:
    """The same run with different noise; draw 0 is the noise stored with it."""
    if draw == 0:
        return stream
    rng = np.random.default_rng((draw, stream.run, SUITES.index(stream.suite)))
    return replace(
        stream,
        noise_torque=rng.standard_normal(stream.noise_torque.shape),
        noise_wrench=rng.standard_normal(stream.noise_wrench.shape),
    )


def with_velocity_noise(stream: Stream, deviation: float) -> Stream:
    """The same run with noise of that standard deviation [rad/s] in the velocities of joints that move."""
    chance = np.random.default_rng((stream.run, len(stream.t)))
    return replace(stream, qd=measured_velocity(stream.qd, deviation, chance))


def _runs(data: dict[str, np.ndarray], robot: str, suite: str) -> Iterator[Stream]:
    touched, link, point, normal, wrench = _contacts(data, suite)
    qd = data["qd"].astype(float)
    if suite == "probe":
        qd += _HALF_STEP * data["qdd"]
    for run in range(int(data["run"].max()) + 1):
        rows = np.flatnonzero(data["run"] == run)
        first, last = int(rows[0]), int(rows[-1]) + 1
        here = slice(first, last)
        if suite == "motion":
            kind = KINDS[int(data["run_kind"][run])]
            multi = bool(data["run_multi"][run])
            events = tuple(
                Event(int(start) - first, int(stop) - first, EVENT_TYPES[int(type_)])
                for start, stop, type_, of in zip(
                    data["ev_start"], data["ev_stop"], data["ev_type"], data["ev_run"], strict=True
                )
                if of == run
            )
        else:
            kind, multi = KINDS[int(data["run_moving"][run])], False
            events = _presses(touched[here])
        yield Stream(
            robot=robot,
            gravity=float(np.linalg.norm(data["gravity"])),
            suite=suite,
            run=run,
            kind=kind,
            multi=multi,
            t=data["t"][here],
            q=data["q"][here],
            qd=qd[here],
            torque=data["tau"][here],
            base_wrench=data["base_wrench"][here],
            noise_torque=data["noise_tau"][here].astype(float),
            noise_wrench=data["noise_wrench"][here].astype(float),
            touched=touched[here],
            link=link[here],
            point_base=point[here],
            normal_base=normal[here],
            wrench=wrench[here],
            events=events,
        )


def _contacts(
    data: dict[str, np.ndarray], suite: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Whether touched; the link if there is only one; point, normal and wrench of that contact."""
    if suite == "probe":
        force, point = data["f"], data["c_base"]
        moment = np.cross(point, force) + data["m_c"]
        single = (data["fn_link"] > 0.0).sum(axis=1) == 1
        link = np.where(data["active"] & single, data["link"], -1).astype(np.int64)
        return data["active"], link, point, data["n_base"].astype(float), np.hstack((force, moment))
    active = data["active"]
    slot = np.where(active[:, 0], 0, 1)
    rows = np.arange(len(slot))
    force, point = data["f"][rows, slot], data["c_base"][rows, slot]
    normal = data["n_base"][rows, slot].astype(float)
    twist = data["xi"][rows, slot, None] * normal
    link = np.where(active.sum(axis=1) == 1, data["link"][rows, slot], -1).astype(np.int64)
    wrench = np.hstack((force, np.cross(point, force) + twist))
    return np.asarray(active.any(axis=1)), link, point, normal, wrench


def _presses(touched: np.ndarray) -> tuple[Event, ...]:
    """Events of presses: a press may lift off briefly, so it lasts from the first touch to the last."""
    rows = np.flatnonzero(touched)
    return (Event(int(rows[0]), int(rows[-1]) + 1, "press"),) if len(rows) else ()
