"""The arrays of `detect_and_localize_block`, allocated once for a whole recording."""

from collections.abc import Callable

import numpy as np

from contactsense.kinematics.simd_kinematics import empty_lanes
from contactsense.robots.jit.declaration import Records
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.block_columns import (
    BASE_WRENCH,
    BASE_WRENCH_STD,
    BIAS,
    CONSISTENCY,
    ENERGY,
    FRICTION,
    JOINTS,
    TORQUE,
    TORQUE_STD,
    block_width,
    group_columns,
)
from contactsense.runtime.block_kernel import BlockInputs, detect_and_localize_block
from contactsense.runtime.buffers import Buffers
from contactsense.runtime.result_rows import LINK, POINT, WIDTH
from contactsense.sample_blocks import BlockEstimates, SampleBlock
from contactsense.scene import Scene
from contactsense.tracking.contact_track import ContactStatus
from contactsense.types import Contact, Estimate

MAX_BLOCK = 8192
"""Maximum number of samples per call of the kernel: it bounds the size of the arrays for recordings of any
length."""


class BlockRunner:
    """Runs the compiled blocks of one localizer."""

    def __init__(
        self,
        scene: Scene,
        scene_sensors: tuple[bool, bool],
        links: int,
        first_primitive: np.ndarray,
        status: Records[ContactStatus],
    ) -> None:
        """Allocate the arrays.

        Args:
            scene: The localizer's.
            scene_sensors: Whether the scene has a base sensor and joint torques.
            links: Number of links that can be distinguished.
            first_primitive: Index of each link's first primitive.
            status: Of the localizer's contact.
        """
        joints = len(scene.robot.joints)
        self._joints, self._scene_sensors, self._first = joints, scene_sensors, first_primitive
        self._status = status
        self._link_sensors = tuple(scene.link_sensors)
        self._flange = (scene.robot.flange_rotation, scene.robot.flange_translation)
        self._flags = np.zeros(MAX_BLOCK, dtype=np.int64)
        self._listed = np.zeros(MAX_BLOCK, dtype=np.int64)
        self._phases = np.zeros((MAX_BLOCK, 3), dtype=np.int64)
        self._best = np.zeros((MAX_BLOCK, WIDTH))
        self._link_probability = np.zeros((MAX_BLOCK, links))
        self._lanes = empty_lanes(joints)

    def run(
        self,
        parts: tuple[Buffers, Skin],
        settings: tuple[bool, int],
        block: SampleBlock,
        estimate: Callable[[float, int], Estimate] | None,
    ) -> BlockEstimates:
        """Process a block of at most `MAX_BLOCK` samples.

        Args:
            parts: Buffers and skin, as arguments of the kernel.
            settings: Whether the link is chosen first, mask of the relevant flags.
            block: The samples.
            estimate: Called with time and flags of each sample with a contact or its end, if that needs more
                than the kernel; None if the kernel does everything.
        """
        count = len(block)
        inputs = self._inputs(block)
        flags, listed = self._flags[:count], self._listed[:count]
        phases, residuals = self._phases[:count], np.empty((count, block_width(self._joints)))
        estimates: dict[int, Estimate] = {}
        at = 0
        while at < count:
            after = detect_and_localize_block(
                *parts, settings, estimate is not None, at, inputs,
                (flags, phases, residuals, listed, self._best, self._link_probability), self._lanes,
            )  # fmt: skip
            at = abs(after)
            if after < 0 and estimate is not None:
                estimates[at - 1] = estimate(float(block.t[at - 1]), int(flags[at - 1]))
                phases[at - 1, 0], phases[at - 1, 1] = self._status[0].phase, self._status[0].number
        return self._collect(block, residuals, estimates)

    def _inputs(self, block: SampleBlock) -> BlockInputs:
        """The samples as arguments of the kernel."""
        sensor_bits = np.zeros(len(block), dtype=np.int64)
        values = []
        sensors = (block.base_wrench, block.joint_torque)
        for i, (value, size) in enumerate(zip(sensors, (6, self._joints), strict=True)):
            if value is None or not self._scene_sensors[i]:
                value = np.zeros((len(block), size))
            else:
                sensor_bits += (~np.isnan(value).all(axis=1)).astype(np.int64) << i
            values.append(value)
        links = np.zeros((len(block), len(self._link_sensors), 6))
        given = block.link_values
        for s, name in enumerate(self._link_sensors):
            if name in given:
                links[:, s] = given[name]
                sensor_bits += (~np.isnan(given[name]).all(axis=1)).astype(np.int64) << s + 2
        t, q, qd, torque, base = map(_writeable, (block.t, block.q, block.qd, values[1], values[0]))
        return t, sensor_bits, q, qd, torque, base, links

    def _collect(
        self, block: SampleBlock, residuals: np.ndarray, estimates: dict[int, Estimate]
    ) -> BlockEstimates:
        count, n = len(block), self._joints
        located = np.flatnonzero(self._listed[:count] > 0)
        sample, contact = located, self._phases[located, 1]
        rows, link_probability = self._best[located], self._link_probability[located]
        # A tool's own frame is that of the flange, not of the body that carries it.
        tool = rows[:, LINK] > self._joints
        rows[tool, POINT] = (rows[tool, POINT] - self._flange[1]) @ self._flange[0]
        if estimates:
            found = [(i, one, estimate) for i, estimate in estimates.items() for one in _acting(estimate)]
            sample = np.array([i for i, _, _ in found], dtype=np.int64)
            contact = np.array([one.id for _, one, _ in found], dtype=np.int64)
            rows = np.array([self._row(one) for _, one, _ in found]).reshape(-1, WIDTH)
            link_probability = np.array([estimate.link_probability for _, _, estimate in found]).reshape(
                len(found), link_probability.shape[1]
            )
        return BlockEstimates(
            t=block.t,
            flags=self._flags[:count].copy(),
            phase=self._phases[:count, 0].copy(),
            number=self._phases[:count, 1].copy(),
            usable=self._phases[:count, 2:] & np.array([1, 2]) > 0,
            energy=residuals[:, ENERGY],
            consistency=residuals[:, CONSISTENCY:BASE_WRENCH],
            base_wrench=residuals[:, BASE_WRENCH:BASE_WRENCH_STD],
            base_wrench_std=residuals[:, BASE_WRENCH_STD:JOINTS],
            joint_torque=residuals[:, group_columns(TORQUE, n)],
            joint_torque_std=residuals[:, group_columns(TORQUE_STD, n)],
            joint_bias=residuals[:, group_columns(BIAS, n)],
            joint_friction=residuals[:, group_columns(FRICTION, n)],
            sample=sample,
            contact=contact,
            rows=rows,
            link_probability=link_probability,
            estimates=estimates,
        )

    def _row(self, contact: Contact) -> np.ndarray:
        numbers = (
            contact.link_index, contact.primitive + self._first[contact.link_index], contact.probability,
            contact.torsion,
        )  # fmt: skip
        vectors = (contact.point, contact.point_base, contact.normal_base, contact.force_base)
        return np.concatenate((numbers, *vectors, contact.covariance.ravel()))


def _writeable(array: np.ndarray) -> np.ndarray:
    """The array, or a writable copy: for a read-only array, the kernel would be compiled again."""
    return array if array.flags.writeable else array.copy()


def _acting(estimate: Estimate) -> tuple[Contact, ...]:
    """Simultaneous contacts of the best explanation."""
    return estimate.contacts if estimate.status == "multiple" else estimate.contacts[:1]
