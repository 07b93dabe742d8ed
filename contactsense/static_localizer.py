"""`StaticLocalizer`: explains measurements of an arm at rest, each independent of all others."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from contactsense.detection.thresholds import SampleThresholds
from contactsense.kinematics.simd_kinematics import empty_lanes
from contactsense.multi_contact.locator import SEVERAL_CONTACTS, MultiContactLocator
from contactsense.output.batch import Batch, batch_of
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.jit.kernel import loaded
from contactsense.robots.jit.progress_bar import Notify, shown_compilation
from contactsense.runtime.buffers import Buffers, KernelBuffers
from contactsense.runtime.detectable import DetectableForce
from contactsense.runtime.intrinsic import batch_intrinsic
from contactsense.runtime.kernels import AT_REST, CHECKED, DETECT_ONLY, EXTERNAL, LINK_FIRST, batch
from contactsense.runtime.measurement import DOUBTFUL, NOT_FINITE, UNTOUCHED
from contactsense.runtime.parallel_batch import explain_rows
from contactsense.runtime.result_rows import WIDTH
from contactsense.runtime.state import empty_state
from contactsense.scene import Scene, check_scene
from contactsense.scene_model.constants import Constants, build_constants
from contactsense.scene_model.skin_grids import skin_argument
from contactsense.sensors.link_values import by_field
from contactsense.sensors.sample_fields import SENSORS, SampleFields
from contactsense.sensors.stream_state import Readings
from contactsense.sensors.usable_sensors import Usable, sensor_bits_of
from contactsense.sensors.validation import as_floats, checked_flag, checked_rows
from contactsense.types import Contact, Estimate

Method = Literal["joint", "torques_first", "intrinsic"]
"""How link and position are estimated. `joint`: together. `torques_first`: the link from the evidence of base
wrench and torques alone, then the position on it. `intrinsic`: the link likewise (Eberman & Salisbury 1989),
then the closed form of Bicchi, Salisbury & Brock (1993) on its primitives; it needs a base sensor and knows
no probabilities. The last two are baselines for comparison."""

_Limits: TypeAlias = tuple[Usable, float, float, int, int]
"""Which sensors measure; threshold of detection; smallest detectable force [N]; `sensor_bits` and `options`
for `contactsense.runtime.kernels.process`."""


class StaticLocalizer:
    """The part of `contactsense.Localizer` that explains single measurements. It holds what both parts need:
    constants, state and work space of the kernels."""

    def __init__(self, scene: Scene, method: Method, progress: bool | Notify | None) -> None:
        """Build everything that does not depend on a stream. Arguments and errors as for
        `contactsense.Localizer`."""
        self._progress = progress
        check_scene(scene)
        if method not in get_args(Method):
            raise ValueError(f"method: expected one of {', '.join(get_args(Method))}, got {method!r:.60}")
        if method == "intrinsic" and (scene.base_wrench is None or scene.contacts > 1):
            raise ValueError(
                "method: 'intrinsic' needs base_wrench and contacts: 1 in the scene, got "
                f"{'no base_wrench' if scene.base_wrench is None else f'contacts: {scene.contacts}'}"
            )
        self.scene, self._method = scene, method
        self._link_first = method != "joint"
        self._options = LINK_FIRST if self._link_first else 0
        self._intrinsic = method == "intrinsic"
        constants = build_constants(scene)
        self._buffers = KernelBuffers(constants, empty_state(constants))
        self._skin = skin_argument(scene)
        self._arguments = self._buffers.arguments
        self._kernel_args = (self._arguments, self._skin)
        self._plausible = PlausibleLimits(scene)
        self._joints, self._links = constants.model.joints, len(constants.touchable)
        self._found: Callable[[], list[int]] = self._buffers.state.answer.integers.tolist
        self._estimate_builder = EstimateBuilder(scene, constants, self._buffers.state)
        self._locator: MultiContactLocator | None = None
        if scene.contacts > 1:
            self._locator = MultiContactLocator(
                scene, self._buffers, self._kernel_args, self._estimate_builder
            )
        self._scene_sensors = (scene.base_wrench is not None, scene.joint_torque is not None)
        self._link_sensors = tuple(scene.link_sensors)
        self._sample_fields = SampleFields(self._scene_sensors, self._link_sensors, self._joints)
        self._thresholds = SampleThresholds(scene)
        self._detectable = DetectableForce(constants, self._buffers.state, self._thresholds)
        # For the measurements so far: without base wrench, without torques, whether the arm's weight was
        # subtracted from their values.
        self._detection_limits: dict[tuple[bool, bool, bool], _Limits] = {}
        self._process: Callable[..., int]

    @property
    def constants(self) -> Constants:
        """What the kernels know of the scene; read-only, as it does not change with samples."""
        return self._buffers.constants

    @contextmanager
    def torque_variance(self, variance: np.ndarray) -> Iterator[None]:
        """Within the context, `locate` takes the joint torques for ones with this noise, as means of many
        samples have less of it. With `detect=False` only: thresholds remain those of the scene.

        Args:
            variance: Variance of each joint torque, shape (n,) [Nm^2].

        Raises:
            ValueError: A variance is not finite and positive, or their number is not that of the joints.
        """
        given, own = as_floats("variance", variance), self.constants.sensors.torque_variance
        if given.shape != own.shape or not (np.isfinite(given) & (given > 0.0)).all():
            raise ValueError(f"variance: expected {len(own)} finite positive numbers, got {given}")
        kept = own.copy()
        own[:] = given
        try:
            yield
        finally:
            own[:] = kept

    def locate(
        self,
        q: np.ndarray,
        *,
        base_wrench: np.ndarray | None = None,
        joint_torque: np.ndarray | None = None,
        wrist_wrench: np.ndarray | None = None,
        link_wrenches: Mapping[str, np.ndarray] | None = None,
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
            link_wrenches: The same of each further sensor within the arm, by its name in
                `Scene.link_wrenches`.
            external: Whether the arm's weight has been subtracted from the measurements already (a contact
                wrench w leaves w in `base_wrench` and -s_j . w in `joint_torque`); False: it is subtracted
                here, with the error of `Scene.inertia_error`.
            detect: Return `none` if noise alone explains the measurement; False: a contact is known to be
                present, and whether the measurement can be is not checked.
            contacts: Largest number of simultaneous contacts, 1 to 3. With more than one, the status is
                `multiple` if several explain the measurement better than one.
            known: Contacts that are already present, from one estimate in the same posture by the same
                sensors: their positions have their covariances as prior. They count towards `contacts`. Where
                they leave more of the measurement than noise, `reason` says so, and a single one is
                `ambiguous`.
            drift: Standard deviation of the change of each component of their forces since then [N]; given
                their positions, the forces before it are known as one sample measures them. None: their
                forces are free, about as large as before or as the sensors measure. The smaller, the better a
                new contact is distinguished from them.

        Raises:
            ValueError: an argument has the wrong shape or type, is masked, not finite or implausible
                (mistaken units, values beyond the limits of joints or sensor, a mistaken `external`), or the
                scene has no such sensor.
        """
        # Half of the time of a call is Python's: no function is called that need not be.
        if type(external) is not bool or type(detect) is not bool:
            external, detect = checked_flag("external", external), checked_flag("detect", detect)
        given_links = wrist_wrench is not None or link_wrenches is not None
        links = by_field(wrist_wrench, link_wrenches) if given_links else {}
        limits = None
        if not links:
            limits = self._detection_limits.get((base_wrench is None, joint_torque is None, external))
        if limits is None:
            limits = self._limits_of((base_wrench, joint_torque), links, external)
        usable, threshold, self._estimate_builder.detectable, sensor_bits, options = limits
        locator = None
        if contacts != 1 or known:
            locator = self._set_locator(contacts, known, drift)
            options |= DETECT_ONLY
        if not detect:
            threshold = -1.0
            options &= ~CHECKED
        readings = self._sample_fields.values(q, joint_torque, base_wrench, links)
        count = self._locate_once(readings, sensor_bits, options, threshold)
        if detect and (count == DOUBTFUL or not options & CHECKED):
            self._refuse_implausible("", q, (base_wrench, joint_torque), links, external)
            if options & CHECKED:
                count = self._locate_once(readings, sensor_bits, options & ~CHECKED, threshold)
        if count == UNTOUCHED:
            return self._estimate_builder.without_contacts(0.0, "none")
        if locator is not None:
            with self._shown(SEVERAL_CONTACTS):
                multiple = locator.explain(usable, contacts, known, drift)
            if known or len(multiple.contacts) > 1:
                return multiple
            self._locate_once(readings, sensor_bits, options & ~(CHECKED | DETECT_ONLY), threshold)
        return self._estimate_builder.contacts(0.0, self._found())

    def _limits_of(
        self,
        given: tuple[np.ndarray | None, np.ndarray | None],
        links: Mapping[str, np.ndarray],
        external: bool,
    ) -> _Limits:
        """Those of a measurement by the sensors that have values; without link sensors they are kept."""
        usable = self._given_sensors(given, links)
        options = self._options | AT_REST
        if external:
            options |= EXTERNAL
        if not (self._intrinsic or (links and self._plausible.has_link_range)):
            # The kernel knows no ranges of link sensors.
            options |= CHECKED
        limits = (
            usable,
            self._thresholds.threshold(usable),
            self._detectable.of_measurement(usable, external),
            sensor_bits_of(usable),
            options,
        )
        if not links:
            self._detection_limits[given[0] is None, given[1] is None, external] = limits
        return limits

    def _set_locator(
        self, contacts: int, known: Sequence[Contact], drift: float | None
    ) -> MultiContactLocator:
        """What looks for sets of contacts; raises a ValueError if it cannot do so with these arguments."""
        self._locator = self._locator or MultiContactLocator(
            self.scene, self._buffers, self._kernel_args, self._estimate_builder
        )
        self._locator.check(contacts, known, drift)
        return self._locator

    def _refuse_implausible(
        self,
        row: str,
        q: np.ndarray,
        sensors: Sequence[np.ndarray | None],
        links: Mapping[str, np.ndarray],
        external: bool,
    ) -> None:
        """Raise a ValueError if a measurement is implausible; `row` is added to the name of its field."""
        base = None if sensors[0] is None else np.asarray(sensors[0])
        torque = None if sensors[1] is None else np.asarray(sensors[1])
        given = {name: np.asarray(value) for name, value in links.items()}
        found = self._plausible.request(np.asarray(q), base, torque, given, external)
        if found is not None:
            raise ValueError(f"{found.field}{row}: {found.reason}")

    def _locate_once(self, readings: Readings, sensor_bits: int, options: int, threshold: float) -> int:
        """`contactsense.runtime.kernels.process`.

        Raises:
            ValueError: a reading is not finite or has the wrong size; the message names the argument.
        """
        if self._intrinsic:
            return self._locate_once_intrinsic(readings, sensor_bits, options & EXTERNAL != 0, threshold)
        buffers, skin = self._kernel_args
        found = self._process(buffers, skin, options, threshold, sensor_bits, readings)
        if found != NOT_FINITE:
            return found
        readings = self._sample_fields.checked(readings)
        return self._process(buffers, skin, options, threshold, sensor_bits, readings)

    def _locate_once_intrinsic(
        self, readings: Readings, sensor_bits: int, external: bool, threshold: float
    ) -> int:
        q, _, torque, base, link_wrench = self._sample_fields.checked(readings)
        measured = (q[None], torque[None], base[None], link_wrench[None])
        energy, link_probability, best = np.empty(1), np.empty((1, self._links)), np.empty((1, WIDTH))
        present = (sensor_bits & 2 != 0, sensor_bits >> 2)
        batch_intrinsic(*self._kernel_args, measured, external, *present, energy, link_probability, best)
        return UNTOUCHED if energy[0] <= threshold else int(best[0, 0] >= 0.0)

    def locate_batch(
        self,
        q: np.ndarray,
        *,
        base_wrench: np.ndarray | None = None,
        joint_torque: np.ndarray | None = None,
        wrist_wrench: np.ndarray | None = None,
        link_wrenches: Mapping[str, np.ndarray] | None = None,
        external: bool = True,
        detect: bool = True,
        jobs: int | None = None,
    ) -> Batch:
        """Explain N measurements of an arm at rest, each by its most probable contact.

        The arguments are those of `locate` with a leading axis N; `jobs` is the number of threads, one per
        core if None. `Batch.detected` reports whether a sample shows a contact; the best candidate is
        returned in any case. With `detect=False` contacts are known to be present, and whether the
        measurements can be is not checked. The first call loads the kernel, and compiles it where it is not
        in the cache.

        Raises:
            ValueError: as `locate`; the message names the first such row.
        """
        external, detect = checked_flag("external", external), checked_flag("detect", detect)
        q = checked_rows("q", q, None, self._joints, "rad")
        n = len(q)
        given, links = (base_wrench, joint_torque), by_field(wrist_wrench, link_wrenches)
        usable = self._given_sensors(given, links)
        sizes, units = (6, self._joints), ("N, Nm", "Nm")
        rows = [
            None if value is None else checked_rows(name, value, n, size, unit)
            for name, value, size, unit in zip(SENSORS, given, sizes, units, strict=True)
        ]
        link_rows = {name: checked_rows(name, value, n, 6, "N, Nm") for name, value in links.items()}
        base, torque = rows
        for i in self._plausible.suspects(q, base, torque, link_rows, external) if detect else ():
            row = [None if value is None else value[i] for value in rows]
            link_row = {name: value[i] for name, value in link_rows.items()}
            self._refuse_implausible(f"[{i}]", q[i], row, link_row, external)
        base, torque = (
            np.zeros((n, size)) if value is None else value for value, size in zip(rows, sizes, strict=True)
        )
        link_wrench = np.zeros((n, len(self._link_sensors), 6))
        for s, name in enumerate(self._link_sensors):
            link_wrench[:, s] = link_rows.get(name, 0.0)
        no_contact_energy, link_probability = np.empty(n), np.empty((n, self._links))
        best, still = np.empty((n, WIDTH)), np.zeros(q.shape)

        def explain(buffers: Buffers, part: slice) -> None:
            measured = (q[part], torque[part], base[part], link_wrench[part])
            found = (no_contact_energy[part], link_probability[part], best[part])
            if self._intrinsic:
                batch_intrinsic(buffers, self._skin, measured, external, *usable[1:], *found)
            else:
                lanes = empty_lanes(self._joints)
                batch(
                    buffers, self._skin, measured, still[part], external, usable, self._link_first, found,
                    lanes,
                )  # fmt: skip

        with self._shown((batch_intrinsic if self._intrinsic else batch,)):
            explain_rows(explain, n, self._buffers, jobs)
        return batch_of(best, link_probability, no_contact_energy > self._thresholds.threshold(usable))

    def _shown(self, kernels: tuple[Any, ...]) -> AbstractContextManager[object]:
        """Shows the compilation of kernels that the localizer has not needed so far."""
        return nullcontext() if all(map(loaded, kernels)) else shown_compilation(kernels, self._progress)

    def _given_sensors(self, given: tuple[np.ndarray | None, ...], links: Mapping[str, np.ndarray]) -> Usable:
        base, torque = given[0] is not None, given[1] is not None
        in_scene = self._scene_sensors
        if (base and not in_scene[0]) or (torque and not in_scene[1]):
            name = SENSORS[0] if base and not in_scene[0] else SENSORS[1]
            raise ValueError(f"{name}: the scene has no such sensor, got a value")
        for name in links:
            if name not in self._link_sensors:
                raise ValueError(f"{name}: the scene has no such sensor, got a value")
        if self._intrinsic and given[0] is None:
            raise ValueError("base_wrench: expected a value, which method 'intrinsic' needs, got none")
        if given[0] is None and given[1] is None:
            raise ValueError("base_wrench, joint_torque: expected at least one of the two, got none")
        bits = sum(1 << s for s, name in enumerate(self._link_sensors) if name in links) if links else 0
        return base, torque, bits
