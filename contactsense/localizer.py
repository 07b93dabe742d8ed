"""`Localizer`: receives samples, returns estimates. It holds all state that persists between samples."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Literal

import numpy as np

from contactsense.detection.thresholds import SampleThresholds
from contactsense.localization.candidate_buffers import MAX_CANDIDATES
from contactsense.multi_contact.contact_set_builder import ContactSetBuilder
from contactsense.multi_contact.kernels import explain_contact_sets
from contactsense.multi_contact.locator import MultiContactLocator
from contactsense.multi_contact.tracker import MultiContactTracker
from contactsense.output.batch import Batch, batch_of
from contactsense.output.degraded_reason import degraded_reason
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.residuals.bias_filter import restart as restart_bias_filter
from contactsense.residuals.noise_scale import restart as restart_noise_scale
from contactsense.residuals.sensor_consistency import restart as restart_consistency
from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.robots.jit.kernel import disable_compilation
from contactsense.robots.jit.progress_bar import shown_compilation
from contactsense.runtime.block_runner import MAX_BLOCK, BlockRunner
from contactsense.runtime.buffers import KernelBuffers
from contactsense.runtime.constants import build_constants
from contactsense.runtime.detectable import DetectableForce
from contactsense.runtime.kernels import batch, detect, localize, locate_once
from contactsense.runtime.picked_up_payload import PickedUpPayload
from contactsense.runtime.plausibility import PlausibleLimits
from contactsense.runtime.result_rows import WIDTH
from contactsense.runtime.sample_blocks import BlockEstimates, SampleBlock
from contactsense.runtime.skin_grids import skin_of
from contactsense.runtime.state import empty_state
from contactsense.runtime.stream_screening import StreamScreening
from contactsense.scene import Scene
from contactsense.sensors.sample_fields import SENSORS, SampleFields
from contactsense.sensors.stream_state import (
    DEGRADED,
    REPEATED,
    RESTARTED,
    SCALE,
    STEP,
    TOUCHED,
    UNUSABLE,
    WRONG_SIZE,
)
from contactsense.sensors.stream_state import restart as restart_stream
from contactsense.sensors.timing import reset_timing
from contactsense.sensors.validation import checked_rows
from contactsense.tracking.contact_tracker import HOLD, NEW, NONE, NUMBER, PHASE, SLIDE, end_contact
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Sample

Method = Literal["joint", "torques_first"]
"""How link and position are estimated. `joint`: together. `torques_first`: the link from the evidence of base
wrench and torques alone, then the position on it; a baseline for comparison."""
_PHASES: dict[int, Phase] = {NONE: "", NEW: "new", HOLD: "hold", SLIDE: "slide"}
_NOT_FINITE = "time, positions or velocities are not finite or implausibly large: sample not used"
_EVENTS: dict[int, EventKind] = {NEW: "onset", HOLD: "hold", SLIDE: "slide"}


def kernels_of(scene: Scene) -> tuple[Any, ...]:
    """Compiled functions that a localizer for this scene calls from Python."""
    single = (detect, localize, locate_once, batch)
    return (*single, explain_contact_sets) if scene.contacts > 1 else single


class Localizer:
    """Localizes contacts on the arm of one scene.

    One instance serves one stream and one thread; instances are independent. The first one after installation
    compiles the kernels, which takes minutes; the machine code is cached on disk.
    """

    def __init__(
        self,
        scene: Scene,
        method: Method = "joint",
        *,
        progress: bool | Callable[[CompilationProgress], object] | None = None,
    ) -> None:
        """Prepare for `scene`, and compile the kernels that are not in the cache.

        Args:
            scene: The arm, its mounting and its sensors.
            method: How link and position are estimated.
            progress: Whether a bar on stderr shows the progress of the compilation; None: on a terminal and
                in a notebook. A function is called with the progress instead.
        """
        if not isinstance(scene, Scene):
            raise TypeError(
                f"scene: expected a Scene, as in Localizer(Scene(robot='ur5e')), got {scene!r:.60}"
            )
        self.scene = scene
        self._gate = method == "torques_first"
        constants = build_constants(scene)
        self._buffers = KernelBuffers(constants, empty_state(constants))
        self._buffer_args = (self._buffers.floats, self._buffers.integers, self._buffers.sizes)
        skin = skin_of(scene)
        self._batch_args, self._sample_args = (*self._buffer_args, skin), (*self._buffer_args, *skin)
        self._plausible = PlausibleLimits(scene)
        self._screening = StreamScreening(scene, self._plausible)
        self._stream, self._bandwidth = self._buffers.state.stream, scene.bandwidth
        self._joints, self._links, primitives, _, _ = self._buffers.sizes
        self._rows = np.zeros((max(primitives, MAX_CANDIDATES), WIDTH))
        self._estimate_builder = EstimateBuilder(scene, constants.surfaces.start)
        self._locator: MultiContactLocator | None = None
        self._multi_tracker: MultiContactTracker | None = None
        if scene.contacts > 1:
            self._locator = MultiContactLocator(
                scene, self._buffers, self._batch_args, self._estimate_builder
            )
            self._multi_tracker = MultiContactTracker(
                scene, self._buffers, self._locator, ContactSetBuilder(scene, self._estimate_builder)
            )
        self._scene_sensors = (
            scene.base_wrench is not None,
            scene.joint_torque is not None,
            scene.wrist_wrench is not None,
        )
        self._sensor_sizes = (6, self._joints, 6)
        self._sample_fields = SampleFields(self._scene_sensors, self._joints)
        self._zeros = tuple(np.zeros(size) for size in self._sensor_sizes)
        self._thresholds = SampleThresholds(scene, self._sensor_sizes)
        self._detectable = DetectableForce(
            constants, self._buffers.state, self._sensor_sizes, self._thresholds
        )
        self._payload = PickedUpPayload(scene, self._buffers) if scene.picks_up else None
        self._block_runner: BlockRunner | None = None
        self.reset()
        with shown_compilation(kernels_of(scene), progress):
            self._warm_up()

    def reset(self) -> None:
        """Discard all samples and contacts; the next sample starts a new stream."""
        constants, state = self._buffers.constants, self._buffers.state
        restart_stream(state.stream)
        restart_consistency(state.consistency, self.scene.force, self.scene.contacts == 1)
        end_contact(state.track)
        state.track.scalars[NUMBER] = 0.0
        if self._multi_tracker is not None:
            self._multi_tracker.forget()
        self._screening.reset()
        self._detectable.reset()
        for array, initial in zip(state.model, constants.model, strict=True):
            array[:] = initial
        state.torque_model.bias[:] = constants.torque_model.bias
        weight = constants.model.mass[0] * np.append(
            constants.gravity, np.cross(constants.model.com[0], constants.gravity)
        )
        restart_bias_filter(state.bias_filter, self.scene.inertia_error, weight)
        restart_noise_scale(state.noise_scale, constants.sensors.base_covariance)
        self._phase, self._number = NONE, 0
        if self._payload is not None:
            self._payload.reset()

    @property
    def refusals(self) -> tuple[str, ...]:
        """What was implausible in the stream so far, for each field the first time: expected and given
        value."""
        return tuple(self._screening.first.values())

    @property
    def biases(self) -> tuple[np.ndarray, np.ndarray]:
        """Estimated biases: of the base wrench, base axes, shape (6,) [N, Nm], and of the joint torques,
        shape (n,) [Nm]."""
        state = self._buffers.state
        return state.bias_filter.bias.copy(), state.torque_model.bias.copy()

    def step(self, sample: Sample) -> Estimate:
        """Process the next sample of a live stream and estimate the present contacts; the arm may move.

        A sensor whose value is None, not finite or beyond its limits has no value in this sample. A sample
        whose positions or velocities are not finite, or whose positions are beyond the joints' limits and one
        turn, is not used. A base sensor that at the start of the stream, at rest, does not carry the weight
        of arm and tool is not used until it does. None of this raises: the estimate is `degraded` with a
        reason.

        Raises:
            ValueError: a field has the wrong shape; the message names it.
        """
        screen, fields = self._screening.screened, self._sample_fields.fields
        try:
            flags = detect(*self._buffer_args, self._bandwidth, *fields(screen(sample)))
        except (TypeError, ValueError, AttributeError):
            flags = WRONG_SIZE
        if flags == WRONG_SIZE:
            sample = self._sample_fields.shaped(sample)
            flags = detect(*self._buffer_args, self._bandwidth, *fields(screen(sample)))
        flags &= self._sample_fields.relevant_flags
        if flags == 0 and self._phase == NONE:
            return self._estimate_builder.no_contact(sample.t, self._detectable.in_stream())
        return self._estimate(sample.t, flags)

    def _estimate(self, t: float, flags: int) -> Estimate:
        """The estimate for the sample that `detect` has processed, unless it is simply `none`."""
        self._estimate_builder.detectable = self._detectable.after_change(self._usable())
        if flags & (UNUSABLE | REPEATED):
            return self._not_used(t, flags, self._screening.refused.get("q", _NOT_FINITE))
        if flags & RESTARTED and self._multi_tracker is not None:
            self._multi_tracker.forget()
        count = -1
        if flags & TOUCHED:
            count = localize(*self._sample_args, self._bandwidth, self._gate, self._rows)
        kinds, release = self._phase_change(t)
        if self._phase == HOLD and self._payload is not None and self._usable()[:2] == (True, True):
            mass = self._payload.step()
            if mass is not None:
                return self._picked_up(t, mass)
        reason = ""
        if flags & DEGRADED:
            step = float(self._stream.scalars[STEP])
            consistency = self._buffers.state.consistency
            reason = degraded_reason(flags, consistency, self._screening.refused, step)
        if self._multi_tracker is not None:
            if count < 0:
                release += self._multi_tracker.end(t, self._number)
            else:
                estimate, self._number = self._multi_tracker.step(
                    t, self._usable(), self._number, count > 0, reason
                )
                if estimate is not None:
                    return estimate
        if count < 0:
            return self._estimate_builder.without_contacts(
                t, "degraded" if reason else "none", reason, release
            )
        return self._estimate_builder.contacts(
            t, self._buffers.state, self._rows, count, reason, self._number, _PHASES[self._phase], kinds
        )

    def _not_used(self, t: float, flags: int, why: str) -> Estimate:
        """The estimate for a sample that is not used; `why`: what is unusable about it."""
        reason = why if flags & UNUSABLE else "same time as the previous sample: sample not used"
        return self._estimate_builder.without_contacts(t, "degraded", reason)

    def _usable(self) -> tuple[bool, bool, bool]:
        """Which of base wrench, joint torques and wrist wrench can be used in the newest sample."""
        base, torque, wrist = self._stream.usable[:3].tolist()
        return base > 0.0, torque > 0.0, wrist > 0.0

    def _picked_up(self, t: float, mass: float) -> Estimate:
        """The contact was a payload, which is now part of the model: restart the observers."""
        event = Event("weight", self._number, t, self.scene.robot.link_names[-1], mass)
        reset_timing(self._stream.timing)
        end_contact(self._buffers.state.track)
        self._phase = NONE
        return self._estimate_builder.without_contacts(t, "none", events=(event,))

    def _phase_change(self, t: float) -> tuple[tuple[EventKind, ...], tuple[Event, ...]]:
        """Events of the contact in this sample: kinds of its own events, and its release."""
        scalars = self._buffers.state.track.scalars
        phase, previous = int(scalars[PHASE]), self._phase
        if phase == previous:
            return (), ()
        self._phase = phase
        if phase == NONE:
            return (), (Event("release", self._number, t),)
        if phase == NEW:
            self._number = int(scalars[NUMBER])
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
        """Explain one measurement of an arm at rest, independent of other samples.

        Args:
            q: Joint positions, shape (n,) [rad].
            base_wrench: Wrench of the arm on the base sensor, base axes, about the base origin, shape (6,)
                [N, Nm].
            joint_torque: Torque of each actuator, shape (n,) [Nm].
            wrist_wrench: Wrench on the wrist sensor of everything distal to it, base axes, base origin, shape
                (6,) [N, Nm].
            external: Whether the arm's weight has been subtracted from the measurements already (a contact
                wrench w leaves w in `base_wrench` and -s_j . w in `joint_torque`); False: it is subtracted
                here.
            detect: Return `none` if noise alone explains the measurement; False: a contact is known to be
                present, and whether the measurement can be is not checked.
            contacts: Largest number of simultaneous contacts, 1 to 3. With more than one, the status is
                `multiple` if several explain the measurement better than one.
            known: Contacts that are already present, from an estimate in the same posture: their positions
                have their covariances as prior. They count towards `contacts`.
            drift: Standard deviation of the change of each component of their forces since then [N]; None:
                their forces are free. The smaller, the better a new contact is distinguished from them.

        Raises:
            ValueError: an argument has the wrong shape, is not finite or cannot be (units mistaken, values
                beyond the joints' or the sensor's limits, `external` mistaken), or the scene has no such
                sensor.
        """
        usable = self._given_sensors((base_wrench, joint_torque, wrist_wrench))
        look_for_sets = contacts != 1 or len(known) > 0
        if look_for_sets:
            self._locator = self._locator or MultiContactLocator(
                self.scene, self._buffers, self._batch_args, self._estimate_builder
            )
            self._locator.check(contacts, known, drift)
        threshold = self._thresholds.threshold(usable) if detect else -1.0
        count, no_contact_energy = self._locate_once(
            self._sample_fields.values(q, joint_torque, base_wrench, wrist_wrench),
            external,
            usable,
            threshold,
        )
        self._estimate_builder.detectable = self._detectable.of_measurement(usable)
        if detect:
            self._refuse_implausible("", q, (base_wrench, joint_torque, wrist_wrench), external)
        if no_contact_energy <= threshold:
            return self._estimate_builder.without_contacts(0.0, "none")
        estimate = self._estimate_builder.contacts(0.0, self._buffers.state, self._rows, count)
        if look_for_sets and self._locator is not None:
            multiple = self._locator.explain(usable, contacts, known, drift)
            if known or len(multiple.contacts) > 1:
                return multiple
        return estimate

    def _refuse_implausible(
        self, row: str, q: np.ndarray, sensors: Sequence[np.ndarray | None], external: bool
    ) -> None:
        """Raise a ValueError if a measurement cannot be; `row` is added to the name of its field."""
        base, torque, wrist = (None if value is None else np.asarray(value) for value in sensors)
        found = self._plausible.request(np.asarray(q), base, torque, wrist, external)
        if found is not None:
            raise ValueError(f"{found.field}{row}: {found.reason}")

    def _locate_once(
        self,
        values: tuple[np.ndarray, ...],
        external: bool,
        usable: tuple[bool, bool, bool],
        threshold: float,
    ) -> tuple[int, float]:
        """`contactsense.runtime.kernels.locate_once`; values of other array types are converted.

        Raises:
            ValueError: a value cannot be converted; the message names the argument.
        """
        options = (external, *usable, self._gate, threshold, self._rows)
        try:
            count, no_contact_energy = locate_once(*self._sample_args, *values, *options)
        except TypeError:
            count = -1
        if count < 0:
            count, no_contact_energy = locate_once(
                *self._sample_args, *self._sample_fields.checked(*values), *options
            )
        return count, no_contact_energy

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

        The arguments are those of `locate` with a leading axis N. `detected` reports whether a sample shows a
        contact; the best candidate is returned in any case.
        """
        q = checked_rows("q", q, None, self._joints, "rad")
        n = len(q)
        given = (base_wrench, joint_torque, wrist_wrench)
        usable = self._given_sensors(given)
        values = [
            np.zeros((n, self._sensor_sizes[i]))
            if value is None
            else checked_rows(SENSORS[i], value, n, self._sensor_sizes[i], "N, Nm")
            for i, value in enumerate(given)
        ]
        rows = [None if value is None else values[k] for k, value in enumerate(given)]
        base, torque, wrist = rows
        for i in self._plausible.suspects(q, base, torque, wrist, external):
            row = [None if value is None else value[i] for value in rows]
            self._refuse_implausible(f"[{i}]", q[i], row, external)
        no_contact_energy, link_probability, best = (
            np.empty(n),
            np.empty((n, self._links)),
            np.empty((n, WIDTH)),
        )
        batch(
            *self._batch_args, q, values[1], values[0], values[2], external, *usable, self._gate,
            no_contact_energy, link_probability, best, self._rows,
        )  # fmt: skip
        return batch_of(best, link_probability, no_contact_energy > self._thresholds.threshold(usable))

    def run(self, recording: Iterable[Sample]) -> Iterator[Estimate]:
        """Estimates for a whole stream of samples, from its start."""
        self.reset()
        for sample in recording:
            yield self.step(sample)

    def run_blocks(
        self, recording: Iterable[SampleBlock], *, estimates: bool = False
    ) -> Iterator[BlockEstimates]:
        """The estimates of `run` for a whole stream, with samples and estimates as arrays: for recordings, at
        the speed of compiled code.

        Blocks of more than a few thousand samples are returned in parts. With `Scene.contacts` above 1, or if
        the arm picks up payloads, or with `estimates`, samples with a contact take as long as in `step`.

        Args:
            recording: The blocks.
            estimates: Fill in `BlockEstimates.estimates` in any case.

        Raises:
            ValueError: a field of a block has the wrong shape; the message names it.
        """
        self.reset()
        track = self._buffers.state.track
        if self._block_runner is None:
            first = self._buffers.constants.surfaces.start
            self._block_runner = BlockRunner(
                self.scene, self._scene_sensors, self._links, first, track.scalars
            )
        compiled_only = self._multi_tracker is None and self._payload is None and not estimates
        settings = (self._bandwidth, self._gate, self._sample_fields.relevant_flags)
        for block in recording:
            whole = self._screening.screened_block(SampleBlock.checked(block, self._joints))
            for part in whole.split(MAX_BLOCK):
                found = self._block_runner.run(
                    self._sample_args, settings, part, self._rows, None if compiled_only else self._estimate
                )
                self._phase, self._number = int(track.scalars[PHASE]), int(track.scalars[NUMBER])
                yield found

    def quiet_estimate(self, t: float, flags: int) -> Estimate:
        """The estimate for a sample of the newest block of `run_blocks` that `BlockEstimates.estimates` does
        not list: no contact acts or ends in it.

        Args:
            t: Time of the sample [s].
            flags: Its `BlockEstimates.flags`.

        Returns:
            As `step` returns it, with the reasons for inconsistency at the end of the block. `detectable` is
            that at the end of the block too; infinite if the status is `degraded`.
        """
        self._estimate_builder.detectable = math.inf
        if flags & (UNUSABLE | REPEATED):
            return self._not_used(t, flags, _NOT_FINITE)
        if flags & DEGRADED:
            reason = degraded_reason(flags, self._buffers.state.consistency, {}, 0.0)
            return self._estimate_builder.without_contacts(t, "degraded", reason)
        return self._estimate_builder.no_contact(t, self._detectable.after_change(self._usable()))

    def _given_sensors(self, given: tuple[np.ndarray | None, ...]) -> tuple[bool, bool, bool]:
        for name, value, in_scene in zip(SENSORS, given, self._scene_sensors, strict=True):
            if value is not None and not in_scene:
                raise ValueError(f"{name}: the scene has no such sensor, got a value")
        if given[0] is None and given[1] is None:
            raise ValueError("base_wrench, joint_torque: expected at least one of the two, got none")
        return given[0] is not None, given[1] is not None, given[2] is not None

    def _warm_up(self) -> None:
        """Compile the sample path before the first sample."""
        zero = self._zeros[1]
        base, torque, wrist = (
            zeros if in_scene else None
            for zeros, in_scene in zip(self._zeros, self._scene_sensors, strict=True)
        )
        detect(
            *self._buffer_args, self._bandwidth,
            *self._sample_fields.fields(self._sample_fields.compile_sample()),
        )  # fmt: skip
        disable_compilation(detect)
        self._stream.usable[:] = (*self._scene_sensors, False, False)
        self._stream.scalars[SCALE] = 1.0
        localize(*self._sample_args, self._bandwidth, self._gate, self._rows)
        rows = [None if value is None else value[None] for value in (base, torque, wrist)]
        self.locate_batch(zero[None], base_wrench=rows[0], joint_torque=rows[1], wrist_wrench=rows[2])
        self._locate_once(
            self._sample_fields.values(self._sample_fields.compile_sample().q),
            False,
            self._scene_sensors,
            -1.0,
        )
        disable_compilation(locate_once)
        self.locate(
            zero, base_wrench=base, joint_torque=torque, wrist_wrench=wrist, contacts=self.scene.contacts,
            detect=False,
        )  # fmt: skip
        self.reset()
