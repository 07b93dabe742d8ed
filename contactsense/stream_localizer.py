"""`StreamLocalizer`: receives the samples of a stream, returns estimates. It holds all state that persists
between samples."""

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np

from contactsense.multi_contact.contact_set_builder import ContactSetBuilder
from contactsense.multi_contact.locator import SEVERAL_CONTACTS
from contactsense.multi_contact.tracking.tracker import MultiContactTracker
from contactsense.output.degraded_reason import SET_BACK, degraded_reason
from contactsense.plausibility.stream_screening import StreamScreening
from contactsense.plausibility.stream_start import FROM_START, StreamStart
from contactsense.robots.jit.compile_beside import compiled_beside
from contactsense.robots.jit.declaration import numbers
from contactsense.robots.jit.direct_call import direct_call
from contactsense.robots.jit.progress_bar import Notify, shown_compilation
from contactsense.runtime.answer import COUNT, NUMBER, PHASE, PRIMITIVE, SENSORS
from contactsense.runtime.intrinsic import batch_intrinsic, localize_intrinsic
from contactsense.runtime.kernels import SCREENED, detect, process
from contactsense.runtime.picked_up_payload import PickedUpPayload
from contactsense.runtime.stream_restart import restart_state
from contactsense.scene import Scene
from contactsense.sensors.link_values import as_fields
from contactsense.sensors.stream_state import (
    DEGRADED,
    REPEATED,
    RESTARTED,
    SUSPECT,
    TOUCHED,
    UNUSABLE,
    WRONG_SIZE,
)
from contactsense.sensors.timing import reset_timing
from contactsense.sensors.usable_sensors import (
    Usable,
    usable_residuals_code_in_python,
    usable_sensors_in_python,
)
from contactsense.static_localizer import Method, StaticLocalizer
from contactsense.tracking.contact_track import HOLD, NEW, NONE, SLIDE, end_contact
from contactsense.types import Estimate, Event, EventKind, Phase, Sample

_PHASES: dict[int, Phase] = {NONE: "", NEW: "new", HOLD: "hold", SLIDE: "slide"}
NOT_FINITE = "time, positions or velocities are not finite or implausibly large; the sample is not used"
_NO_VECTORS = (TypeError, ValueError, AttributeError, IndexError)
"""What is raised for a sample whose fields are no vectors of floats of the right size."""
_EVENTS: dict[int, EventKind] = {HOLD: "hold", SLIDE: "slide"}


def kernels_of(scene: Scene, method: Method = "joint") -> tuple[Any, ...]:
    """Compiled functions that a localizer for this scene calls from Python for single samples."""
    kernels: tuple[Any, ...] = (process,)
    if method == "intrinsic":
        kernels += (localize_intrinsic, batch_intrinsic)
    return (*kernels, *SEVERAL_CONTACTS) if scene.contacts > 1 else kernels


class StreamLocalizer(StaticLocalizer):
    """The part of `contactsense.Localizer` that follows a stream, one sample after the other."""

    def __init__(self, scene: Scene, method: Method, progress: bool | Notify | None) -> None:
        """Compile the kernels that are not in the cache. Arguments and errors as for
        `contactsense.Localizer`."""
        super().__init__(scene, method, progress)
        self._screening = StreamScreening(scene, self._plausible)
        self._start = StreamStart(scene.bandwidth, averages=scene.base_wrench is None)
        # For each sample: one look-up instead of two.
        self._fields, self._relevant_flags = self._sample_fields.fields, self._sample_fields.relevant_flags
        self._no_contact = self._estimate_builder.no_contact
        self._stream = self._buffers.state.stream
        status = self._buffers.state.track.status
        self._contact_phase, self._contact_number = numbers(status, "phase"), numbers(status, "number")
        self._multi_tracker: MultiContactTracker | None = None
        if self._locator is not None:
            self._multi_tracker = MultiContactTracker(
                scene, self._buffers, self._locator, ContactSetBuilder(scene, self._estimate_builder)
            )
        self._payload = PickedUpPayload(scene, self._buffers) if scene.picks_up else None
        # A contact's estimate needs no more than the kernel's answer.
        self._is_plain = self._multi_tracker is None and self._payload is None and not self._intrinsic
        self.reset()
        with shown_compilation(kernels_of(scene, method), progress):
            self._warm_up()

    def reset(self) -> None:
        """Discard all samples and contacts; the next sample starts a new stream."""
        self._forget_stream()
        status = self._buffers.state.track.status[0]
        status.number = status.count = 0
        if self._multi_tracker is not None:
            self._multi_tracker.forget()
        self._phase, self._number, self._restart_reason = NONE, 0, ""

    def restart(self, why: str) -> None:
        """Begin another stream of the same arm, whose clock and biases have nothing to do with those so far.

        Unlike `reset`, this goes on for whoever follows the estimates: the next sample releases the contacts
        that are open, and numbers of contacts are not given again.

        Args:
            why: The reason of the next estimate, which is `degraded`.
        """
        self._forget_stream()
        self._restart_reason = why

    def _forget_stream(self) -> None:
        """Forget what all samples have told, except which contacts are open and their numbers."""
        restart_state(self.scene, self._buffers.constants, self._buffers.state)
        self._screening.reset()
        self._start.reset()
        self._detectable.reset()
        if self._payload is not None:
            self._payload.reset()

    @property
    def refusals(self) -> tuple[str, ...]:
        """What was implausible in the stream so far, for each field the first time: expected and given
        value."""
        return tuple(self._screening.first.values())

    @property
    def doubt(self) -> str:
        """Why the scene is in doubt, one sentence: the stream has not fitted a free arm so far. Empty if it
        has."""
        return FROM_START if self._start.doubtful else ""

    @property
    def biases(self) -> tuple[np.ndarray, np.ndarray]:
        """Estimated biases: of the base wrench, base axes, shape (6,) [N, Nm], and of the joint torques,
        shape (n,) [Nm]."""
        state = self._buffers.state
        return state.bias_filter.bias.copy(), state.torque_model.bias.copy()

    @property
    def friction_factors(self) -> np.ndarray:
        """Estimated factor of each joint on the scene's friction, shape (n,): below 1 when the oil is warmer
        than in the calibration. 1 where `Friction.error` is 0."""
        return self._buffers.state.torque_model.friction_factor.copy()

    def step(self, sample: Sample) -> Estimate:
        """Process the next sample of a live stream and estimate the present contacts; the arm may move.

        A sensor whose value is None, not finite or beyond its limits has no value in this sample. A sample
        whose positions or velocities are not finite, or whose positions are beyond the joints' limits and one
        turn, is not used. A base sensor that at the start of the stream, at rest, does not carry the weight
        of arm and tool is not used until it does. None of this raises: the estimate is `degraded` with a
        reason. What has been detected since the start of the stream may come from a wrong scene, and `reason`
        says so.

        Raises:
            ValueError: a field has the wrong shape or is no number; the message names it.
            TypeError: it is no `Sample`.
        """
        screening, flags = self._screening, SUSPECT
        if screening.by_kernel:
            if screening.refused:
                screening.refused = {}
            try:
                t, sensor_bits, readings = self._fields(sample)
                flags = self._process(self._arguments, self._skin, self._options, t, sensor_bits, readings)
            except _NO_VECTORS:
                flags = WRONG_SIZE
        if flags:
            if flags & (SUSPECT | WRONG_SIZE):
                sample, flags = self._process_screened(sample)
            flags &= self._relevant_flags
        if flags == 0 and self._phase == NONE:
            if self._start.watches:
                self._start.update(sample.t, 0)
            detectable = self._detectable
            if detectable.left > 0:
                detectable.left -= 1
                return self._no_contact(sample.t, detectable.value)
            return self._no_contact(sample.t, detectable.in_stream())
        # Once all sensors have proved right, a contact says nothing about the start.
        since_start = (self._start.watches or flags != TOUCHED) and self._start.update(sample.t, flags)
        estimate = self._estimate(sample.t, flags)
        if since_start:
            reason = f"{estimate.reason}; {FROM_START}" if estimate.reason else FROM_START
            return replace(estimate, reason=reason)
        return estimate

    def _process_screened(self, sample: Sample) -> tuple[Sample, int]:
        """Process a sample without what is implausible in it; values of other types are converted.

        Returns:
            The converted sample, and its flags.

        Raises:
            ValueError: a field has the wrong shape or is no number; the message names it.
            TypeError: it is no sample.
        """
        screen, fields = self._screening.screened, self._fields
        flags, arguments = WRONG_SIZE, (*self._kernel_args, self._options | SCREENED)
        with contextlib.suppress(*_NO_VECTORS):
            flags = self._process(*arguments, *fields(screen(sample)))
        if flags == WRONG_SIZE:
            sample = self._sample_fields.shaped(sample)
            flags = self._process(*arguments, *fields(screen(sample)))
        return sample, flags

    def _estimate(self, t: float, flags: int) -> Estimate:
        """The estimate for the sample that has been processed, unless it is simply `none`."""
        found = self._found() if flags & TOUCHED else self._nothing_found()
        self._estimate_builder.detectable = self._detectable.after_change(found[SENSORS])
        if flags == TOUCHED and self._is_plain:
            kinds = () if found[PHASE] == self._phase else self._phase_change(t, found)[0]
            return self._estimate_builder.contacts(t, found, "", self._number, _PHASES[self._phase], kinds)
        if flags & (UNUSABLE | REPEATED):
            return self._not_used(t, flags, self._screening.refused.get("q", NOT_FINITE))
        if flags & TOUCHED and self._intrinsic:
            found[COUNT] = 0
            if self._usable()[0]:
                localize_intrinsic(*self._kernel_args)
                found[: PRIMITIVE + 1] = self._found()[: PRIMITIVE + 1]
        count = found[COUNT]
        unseen = self._restart_reason or (SET_BACK if flags & RESTARTED else "")
        kinds, release = self._phase_change(t, found, unseen)
        if self._phase == HOLD and self._payload is not None and self._usable()[:2] == (True, True):
            mass = self._payload.step()
            if mass is not None:
                return self._picked_up(t, mass)
        reason = ""
        if flags & DEGRADED:
            step = self._stream.clock[0].step
            consistency = self._buffers.state.consistency
            names, refused = self._sample_fields.names, self._screening.refused
            reason = degraded_reason(names, flags, consistency, refused, step, self._restart_reason)
            self._restart_reason = ""
        if self._multi_tracker is not None:
            if count < 0:
                release += self._multi_tracker.end(t, self._number, unseen)
            else:
                estimate, self._number, events = self._multi_tracker.step(
                    t, self._usable(), self._number, count > 0, reason
                )
                self._contact_number[0] = self._number
                if estimate is not None:
                    return estimate
                release += events
        if count < 0:
            return self._estimate_builder.without_contacts(
                t, "degraded" if reason else "none", reason, release
            )
        estimate = self._estimate_builder.contacts(
            t, found, reason, self._number, _PHASES[self._phase], kinds
        )
        return replace(estimate, events=(*release, *estimate.events)) if release else estimate

    def _nothing_found(self) -> list[int]:
        """As `Answer.integers`, for a sample without contact."""
        return [-1, 0, 0, NONE, 0, usable_residuals_code_in_python(self._stream)]

    def _not_used(self, t: float, flags: int, why: str) -> Estimate:
        """The estimate for a sample that is not used; `why`: what is unusable about it."""
        reason = why if flags & UNUSABLE else "same time as the previous sample; the sample is not used"
        return self._estimate_builder.without_contacts(t, "degraded", reason)

    def _usable(self) -> Usable:
        """Which sensors can be used in the newest sample."""
        return usable_sensors_in_python(self._stream)

    def _picked_up(self, t: float, mass: float) -> Estimate:
        """The contact was a payload, which is now part of the model: restart the observers."""
        event = Event("weight", self._number, t, self.scene.robot.link_names[-1], mass)
        reset_timing(self._stream.timing)
        end_contact(self._buffers.state.track)
        self._phase = NONE
        return self._estimate_builder.without_contacts(t, "none", events=(event,))

    def _phase_change(
        self, t: float, found: list[int], unseen: str = ""
    ) -> tuple[tuple[EventKind, ...], tuple[Event, ...]]:
        """Events of the contact in this sample: kinds of its own events, and its release, whose reason is
        `unseen`."""
        phase, previous = found[PHASE], self._phase
        if phase == previous:
            return (), ()
        self._phase = phase
        if phase == NONE:
            return (), (Event("release", self._number, t, reason=unseen),)
        if phase == NEW:
            last, self._number = self._number, found[NUMBER]
            return ("onset" if self._number != last else "resume",), ()
        return (_EVENTS[phase],), ()

    def _warm_up(self) -> None:
        """Compile the sample path before the first sample."""
        base, torque = (
            np.zeros(size) if in_scene else None
            for size, in_scene in zip((6, self._joints), self._scene_sensors, strict=True)
        )
        links = dict.fromkeys(self._link_sensors, np.zeros(6))
        self._no_sample = self._fields(self._sample_fields.compile_sample())
        buffers, _ = self._kernel_args
        with compiled_beside(process, detect, buffers, *self._no_sample, True):
            self._process = direct_call(process, *self._kernel_args, self._options, *self._no_sample)
        self.locate(
            np.zeros(self._joints),
            base_wrench=base,
            joint_torque=torque,
            **as_fields(links),
            contacts=self.scene.contacts,
            detect=False,
        )
        self.reset()
