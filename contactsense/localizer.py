"""`Localizer`: what a program is given for one arm. Single measurements, a live stream and recordings."""

import math
from collections.abc import Callable, Iterable, Iterator

from contactsense.output.degraded_reason import degraded_reason
from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.runtime.block_runner import MAX_BLOCK, BlockRunner
from contactsense.runtime.kernels import DETECTED
from contactsense.sample_blocks import BlockEstimates, SampleBlock
from contactsense.scene import Scene
from contactsense.sensors.stream_state import DEGRADED, REPEATED, TOUCHED, UNUSABLE
from contactsense.sensors.usable_sensors import usable_residuals_code_in_python
from contactsense.sensors.validation import checked_flag
from contactsense.static_localizer import Method
from contactsense.stream_localizer import NOT_FINITE, StreamLocalizer
from contactsense.types import Estimate, Sample


class Localizer(StreamLocalizer):
    """Localizes contacts on the arm of one scene.

    `locate` and `locate_batch` explain single measurements, `step` follows a live stream, `run` and
    `run_blocks` go through a recording.

    One instance serves one stream and one thread; instances are independent. A copy, or what is made from a
    pickle in another process, has the same scene and begins a stream of its own. The first instance after
    installation compiles the kernels, which takes minutes; the machine code is cached on disk.
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
        super().__init__(scene, method, progress)
        self._block_runner: BlockRunner | None = None

    def __repr__(self) -> str:
        scene = self.scene
        own = {"base_wrench": scene.base_wrench, "joint_torque": scene.joint_torque, **scene.link_sensors}
        sensors = ", ".join(field for field, sensor in own.items() if sensor is not None)
        return f"<Localizer {scene.robot.name}: {sensors}>"

    def __reduce__(self) -> tuple[type["Localizer"], tuple[Scene, Method]]:
        """How a copy is made: copied attribute by attribute, it would answer from the arrays of this one."""
        return type(self), (self.scene, self._method)

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
            ValueError: a field of a block has the wrong shape or is no number; the message names it.
            TypeError: it is a single block, or holds something else.
        """
        if isinstance(recording, SampleBlock):
            raise TypeError("recording: expected blocks, as in run_blocks([block]), got a SampleBlock")
        estimates = checked_flag("estimates", estimates)
        self.reset()
        track = self._buffers.state.track
        if self._block_runner is None:
            first = self._buffers.constants.surfaces.start
            self._block_runner = BlockRunner(
                self.scene, self._scene_sensors, self._links, first, track.status
            )
        compiled_only = self._is_plain and not estimates
        settings = (self._link_first, self._sample_fields.relevant_flags)
        for i, block in enumerate(recording):
            if not isinstance(block, SampleBlock):
                raise TypeError(f"recording[{i}]: expected a SampleBlock, got {type(block).__name__}")
            whole = self._screening.screened_block(SampleBlock.checked(block, self._joints))
            for part in whole.split(MAX_BLOCK):
                found = self._block_runner.run(
                    self._kernel_args, settings, part, None if compiled_only else self._estimate_in_block
                )
                self._phase, self._number = int(self._contact_phase[0]), int(self._contact_number[0])
                self._start.update_block(found.t, found.flags)
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
            return self._not_used(t, flags, NOT_FINITE)
        if flags & DEGRADED:
            consistency = self._buffers.state.consistency
            reason = degraded_reason(self._sample_fields.names, flags, consistency, {}, 0.0, "")
            return self._estimate_builder.without_contacts(t, "degraded", reason)
        return self._estimate_builder.no_contact(
            t, self._detectable.after_change(usable_residuals_code_in_python(self._stream))
        )

    def _estimate_in_block(self, t: float, flags: int) -> Estimate:
        """`_estimate` for a sample whose contact has been detected only."""
        if flags & TOUCHED:
            self._process(*self._kernel_args, self._options | DETECTED, *self._no_sample)
        return self._estimate(t, flags)
