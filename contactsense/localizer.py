"""`Localizer`: samples go in, estimates come out. It alone remembers anything between samples."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from contactsense.answer import Composer
from contactsense.arm import build_arm
from contactsense.candidates import MOST
from contactsense.check import checked_rows
from contactsense.entry import batch, listen, once, pursue
from contactsense.feed import silence
from contactsense.follower import restart as restart_follower
from contactsense.health import restart as restart_health
from contactsense.intake import SENSORS, Intake, troubles
from contactsense.levels import SingleLevels
from contactsense.memory import empty_memory
from contactsense.payload import PickUp
from contactsense.report import (
    COVARIANCE,
    FORCE,
    LINK,
    NORMAL,
    POINT_BASE,
    PRIMITIVE,
    PROBABILITY,
    TORSION,
    WIDTH,
)
from contactsense.scene import Scene
from contactsense.several.answer import SetComposer
from contactsense.several.live import SetTracker
from contactsense.several.locator import SetLocator
from contactsense.skin import skin_of
from contactsense.stream import (
    MISFIT,
    REPEATED,
    RESTARTED,
    SCALE,
    TOUCHED,
    TROUBLES,
    UNUSABLE,
)
from contactsense.stream import restart as restart_stream
from contactsense.tracker import HOLD, NEW, NONE, NUMBER, PHASE, SLIDE, forget
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Sample
from contactsense.workspace import Workspace
from robots.compiled import no_more

Method = Literal["joint", "torques_first"]
"""How link and place are decided: `joint`: together; `torques_first`: the link from the evidence of base
wrench and torques alone, then the place on it, which is what a gate in front of a locator does and is kept
for comparison."""
_PHASES: dict[int, Phase] = {NONE: "", NEW: "new", HOLD: "hold", SLIDE: "slide"}
_EVENTS: dict[int, EventKind] = {NEW: "onset", HOLD: "hold", SLIDE: "slide"}


class Batch(NamedTuple):
    """Best explanation of each of N samples, as arrays; base axes unless said otherwise."""

    link: np.ndarray
    """Number of the touched link, -1 where no push on any link explains the sample, shape (N,), int64."""
    primitive: np.ndarray
    """Number of the touched primitive among all of the arm, shape (N,), int64."""
    probability: np.ndarray
    """Probability of this explanation, shape (N,)."""
    link_probability: np.ndarray
    """Probability of each link, shape (N, links)."""
    point_base: np.ndarray
    """Contact centroid, base frame, shape (N, 3) [m]."""
    normal_base: np.ndarray
    """Outward unit normal, shape (N, 3)."""
    force_base: np.ndarray
    """Force on the robot, shape (N, 3) [N]."""
    torsion: np.ndarray
    """Moment on the robot about the outward normal, shape (N,) [Nm]."""
    covariance: np.ndarray
    """Covariance of `point_base`, shape (N, 3, 3) [m^2]."""
    detected: np.ndarray
    """Whether noise alone is too unlikely an explanation, shape (N,), bool."""


class Localizer:
    """Locates contacts on the arm of one scene.

    One instance serves one stream and one thread; instances share nothing. The first one in a fresh
    installation compiles the kernels, which takes a while; they are cached on disk.
    """

    def __init__(self, scene: Scene, method: Method = "joint") -> None:
        """Prepare for `scene`, and compile."""
        self.scene = scene
        self._gate = method == "torques_first"
        arm = build_arm(scene)
        self._work = Workspace(arm, empty_memory(arm))
        self._workspace = (self._work.floats, self._work.integers, self._work.sizes)
        skin = skin_of(scene)
        self._buffers, self._parts = (*self._workspace, skin), (*self._workspace, *skin)
        self._stream, self._bandwidth = self._work.memory.stream, scene.bandwidth
        self._joints, self._links, primitives, _, _ = self._work.sizes
        self._rows = np.zeros((max(primitives, MOST), WIDTH))
        self._composer = Composer(scene, arm.surfaces.start)
        self._sets: SetLocator | None = None
        self._together: SetTracker | None = None
        if scene.contacts > 1:
            self._sets = SetLocator(scene, self._work, self._buffers, self._composer)
            self._together = SetTracker(scene, self._work, self._sets, SetComposer(scene, self._composer))
        self._fitted = (
            scene.base_wrench is not None,
            scene.joint_torque is not None,
            scene.wrist_wrench is not None,
        )
        self._sizes = (6, self._joints, 6)
        self._intake = Intake(self._fitted, self._joints)
        self._blank = tuple(np.zeros(size) for size in self._sizes)
        self._levels = SingleLevels(scene, self._sizes)
        self._pick_up = PickUp(scene, self._work) if scene.picks_up else None
        self.reset()
        self._warm_up()

    def reset(self) -> None:
        """Forget all samples and contacts; the next sample starts a new stream."""
        arm, memory = self._work.arm, self._work.memory
        restart_stream(memory.stream)
        restart_health(memory.health, self.scene.force, self.scene.contacts == 1)
        forget(memory.track)
        memory.track.life[NUMBER] = 0.0
        if self._together is not None:
            self._together.forget()
        for mine, its in zip(memory.model, arm.model, strict=True):
            mine[:] = its
        memory.drive.bias[:] = arm.drive.bias
        weight = arm.model.mass[0] * np.append(arm.gravity, np.cross(arm.model.com[0], arm.gravity))
        restart_follower(memory.follower, self.scene.inertia_error, weight)
        self._phase, self._number = NONE, 0
        if self._pick_up is not None:
            self._pick_up.reset()

    def step(self, sample: Sample) -> Estimate:
        """Take the next sample of a live stream, of an arm that may move, and say what touches it now.

        A sensor whose value is None or not finite counts as silent in this sample. Positions or velocities
        that are not finite make the sample unusable. Neither raises: the estimate is `degraded` and says why.

        Raises:
            ValueError: a field has the wrong shape; the message names it.
        """
        try:
            said = listen(*self._workspace, self._bandwidth, *self._intake.fields(sample))
        except TypeError:
            said = MISFIT
        if said == MISFIT:
            sample = self._intake.shaped(sample)
            said = listen(*self._workspace, self._bandwidth, *self._intake.fields(sample))
        said &= self._intake.heeded
        if said == 0 and self._phase == NONE:
            return self._composer.nothing(sample.t)
        return self._tell(sample.t, said)

    def _tell(self, t: float, said: int) -> Estimate:
        """The estimate for the sample that `listen` took in: something touches it, or something is to be said
        of it."""
        if said & UNUSABLE:
            return self._composer.quiet(
                t,
                "degraded",
                "time, positions or velocities are not finite, or too large to be true: sample unused",
            )
        if said & REPEATED:
            return self._composer.quiet(t, "degraded", "same time as the sample before: sample unused")
        if said & RESTARTED and self._together is not None:
            self._together.forget()
        listed = -1
        if said & TOUCHED:
            listed = pursue(*self._parts, self._bandwidth, self._gate, self._rows)
        kinds, ended = self._news(t)
        if self._phase == HOLD and self._pick_up is not None and self._usable()[:2] == (True, True):
            mass = self._pick_up.step()
            if mass is not None:
                return self._weight(t, mass)
        reason = troubles(said, self._work.memory.health) if said & TROUBLES else ""
        if self._together is not None:
            if listed < 0:
                ended += self._together.end(t, self._number)
            else:
                several, self._number = self._together.step(
                    t, self._usable(), self._number, listed > 0, reason
                )
                if several is not None:
                    return several
        if listed < 0:
            return self._composer.quiet(t, "degraded" if reason else "none", reason, ended)
        return self._composer.contacts(
            t, self._work.memory, self._rows, listed, reason, self._number, _PHASES[self._phase], kinds
        )

    def _usable(self) -> tuple[bool, bool, bool]:
        """Which of base wrench, joint torques and wrist wrench can be used in the newest sample."""
        base, torque, wrist = self._stream.usable[:3].tolist()
        return base > 0.0, torque > 0.0, wrist > 0.0

    def _weight(self, t: float, mass: float) -> Estimate:
        """The contact was a weight, which is in the model now: the observers start anew."""
        event = Event("weight", self._number, t, self.scene.robot.link_names[-1], mass)
        silence(self._stream.feeds)
        forget(self._work.memory.track)
        self._phase = NONE
        return self._composer.quiet(t, "none", events=(event,))

    def _news(self, t: float) -> tuple[tuple[EventKind, ...], tuple[Event, ...]]:
        """What has happened to the contact with this sample: to one that is on, and to one that was."""
        life = self._work.memory.track.life
        phase, before = int(life[PHASE]), self._phase
        if phase == before:
            return (), ()
        self._phase = phase
        if phase == NONE:
            return (), (Event("release", self._number, t),)
        if phase == NEW:
            self._number = int(life[NUMBER])
        return (_EVENTS[phase],), ()

    def locate(
        self,
        q: np.ndarray,
        *,
        base_wrench: np.ndarray | None = None,
        joint_torque: np.ndarray | None = None,
        wrist_wrench: np.ndarray | None = None,
        external: bool = True,
        detect: bool = True,
        contacts: int = 1,
        known: Sequence[Contact] = (),
        drift: float | None = None,
    ) -> Estimate:
        """Explain one measurement of an arm at rest; nothing is remembered.

        Args:
            q: Joint positions, shape (n,) [rad].
            base_wrench: Wrench of the arm on the base sensor, base axes, about the base origin, shape (6,)
                [N, Nm].
            joint_torque: Torque that each actuator applies, shape (n,) [Nm].
            wrist_wrench: Wrench of all beyond the wrist sensor on it, base axes, base origin, shape (6,) [N,
                Nm].
            external: The arm's own weight has been taken off the measurements already (a contact wrench w
                leaves w in `base_wrench` and -s_j . w in `joint_torque`); False: it is taken off here.
            detect: Answer `none` where noise alone explains the measurement; False: a contact is known to be
                there.
            contacts: Most contacts that may act at the same time, 1 to 3. With more than one, the status is
                `multiple` where several explain the measurement better than one.
            known: Contacts that are there already, of an estimate in the same posture: their places have
                their covariances as prior. `contacts` counts them too.
            drift: How much each component of their forces may have changed since, standard deviation [N];
                None: their forces are free. The smaller, the better a new contact is told from them.

        Raises:
            ValueError: an argument has the wrong shape or is not finite, or the scene has no such sensor.
        """
        present = self._present((base_wrench, joint_torque, wrist_wrench))
        several = contacts != 1 or len(known) > 0
        if several:
            self._sets = self._sets or SetLocator(self.scene, self._work, self._buffers, self._composer)
            self._sets.check(contacts, known, drift)
        threshold = self._levels.level(present) if detect else -1.0
        listed, nothing = self._once(
            self._intake.values(q, joint_torque, base_wrench, wrist_wrench), external, present, threshold
        )
        if nothing <= threshold:
            return self._composer.quiet(0.0, "none")
        estimate = self._composer.contacts(0.0, self._work.memory, self._rows, listed)
        if several and self._sets is not None:
            sets = self._sets.explain(present, contacts, known, drift)
            if known or len(sets.contacts) > 1:
                return sets
        return estimate

    def _once(
        self,
        values: tuple[np.ndarray, ...],
        external: bool,
        present: tuple[bool, bool, bool],
        threshold: float,
    ) -> tuple[int, float]:
        """`contactsense.entry.once` of values as they came, or as they can be made to fit.

        Raises:
            ValueError: they cannot; the message names the argument.
        """
        told = (external, *present, self._gate, threshold, self._rows)
        try:
            listed, nothing = once(*self._parts, *values, *told)
        except TypeError:
            listed = -1
        if listed < 0:
            listed, nothing = once(*self._parts, *self._intake.checked(*values), *told)
        return listed, nothing

    def locate_batch(
        self,
        q: np.ndarray,
        *,
        base_wrench: np.ndarray | None = None,
        joint_torque: np.ndarray | None = None,
        wrist_wrench: np.ndarray | None = None,
        external: bool = True,
    ) -> Batch:
        """Explain N measurements of an arm at rest, each by its most probable contact.

        The arguments are those of `locate` with a leading axis N. Whether a sample shows a contact at all is
        said by `detected`; the explanation is given in any case.
        """
        q = checked_rows("q", q, None, self._joints, "rad")
        n = len(q)
        given = (base_wrench, joint_torque, wrist_wrench)
        present = self._present(given)
        values = [
            np.zeros((n, self._sizes[i]))
            if value is None
            else checked_rows(SENSORS[i], value, n, self._sizes[i], "N, Nm")
            for i, value in enumerate(given)
        ]
        nothing, link_probability, best = np.empty(n), np.empty((n, self._links)), np.empty((n, WIDTH))
        batch(
            *self._buffers, q, values[1], values[0], values[2], external, *present, self._gate,
            nothing, link_probability, best, self._rows,
        )  # fmt: skip
        return Batch(
            link=best[:, LINK].astype(np.int64),
            primitive=best[:, PRIMITIVE].astype(np.int64),
            probability=best[:, PROBABILITY],
            link_probability=link_probability,
            point_base=best[:, POINT_BASE],
            normal_base=best[:, NORMAL],
            force_base=best[:, FORCE],
            torsion=best[:, TORSION],
            covariance=best[:, COVARIANCE].reshape(n, 3, 3),
            detected=nothing > self._levels.level(present),
        )

    def run(self, recording: Iterable[Sample]) -> Iterator[Estimate]:
        """Estimates of a whole stream of samples, from its start."""
        self.reset()
        for sample in recording:
            yield self.step(sample)

    def _present(self, given: tuple[np.ndarray | None, ...]) -> tuple[bool, bool, bool]:
        for name, value, fitted in zip(SENSORS, given, self._fitted, strict=True):
            if value is not None and not fitted:
                raise ValueError(f"{name}: the scene has no such sensor, yet a value came")
        if given[0] is None and given[1] is None:
            raise ValueError("base_wrench, joint_torque: expected at least one of the two, got none")
        return given[0] is not None, given[1] is not None, given[2] is not None

    def _warm_up(self) -> None:
        """Compile the sample path before the first sample comes."""
        zero = self._blank[1]
        base, torque, wrist = (
            blank if there else None for blank, there in zip(self._blank, self._fitted, strict=True)
        )
        self.step(self._intake.first())
        no_more(listen)
        self._stream.usable[:] = (*self._fitted, False, False)
        self._stream.clock[SCALE] = 1.0
        pursue(*self._parts, self._bandwidth, self._gate, self._rows)
        rows = [None if value is None else value[None] for value in (base, torque, wrist)]
        self.locate_batch(zero[None], base_wrench=rows[0], joint_torque=rows[1], wrist_wrench=rows[2])
        self._once(self._intake.values(self._intake.first().q), False, self._fitted, -1.0)
        no_more(once)
        self.locate(
            zero, base_wrench=base, joint_torque=torque, wrist_wrench=wrist, contacts=self.scene.contacts,
            detect=False,
        )  # fmt: skip
        self.reset()
