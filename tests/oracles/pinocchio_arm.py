"""An arm in Pinocchio: the oracle for dynamics and for the wrench on the base sensor."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from contactsense.robots import Robot


class PinocchioArm:
    """A `Robot` as a Pinocchio model; link and joint numbers as in `Robot`."""

    def __init__(self, robot: Robot, gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> None:
        self.base = robot.links[0].inertia
        self.model = pin.Model()
        self.model.gravity.linear = np.array(gravity, dtype=float)
        parent = 0
        for joint, link in zip(robot.joints, robot.links[1:], strict=True):
            parent = self.model.addJoint(
                parent,
                pin.JointModelRevoluteUnaligned(joint.axis),
                pin.SE3(joint.rotation, joint.translation),
                joint.name,
            )
            inertia = pin.Inertia(link.inertia.mass, link.inertia.com, link.inertia.tensor)
            self.model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        self.model.armature = np.array([joint.rotor_inertia for joint in robot.joints])
        self.data = self.model.createData()

    def inverse_dynamics(
        self,
        q: np.ndarray,
        qd: np.ndarray,
        qdd: np.ndarray,
        wrenches: Sequence[tuple[int, np.ndarray, np.ndarray]] = (),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Joint torques (n,) and the wrench on the sensor below (6,), force first, at the base origin.

        `wrenches`: (link, force, moment about the link's origin), link axes.
        """
        loads = [pin.Force.Zero() for _ in range(self.model.njoints)]
        on_base = pin.Force(
            self.base.mass * self.model.gravity.linear,
            np.cross(self.base.com, self.base.mass * self.model.gravity.linear),
        )
        for link, force, moment in wrenches:
            if link == 0:
                on_base += pin.Force(force, moment)
            else:
                loads[link] += pin.Force(force, moment)
        external = pin.StdVec_Force()
        external.extend(loads)
        torque = pin.rnea(self.model, self.data, q, qd, qdd, external)
        needed = self.data.liMi[1].act(self.data.f[1])  # by the first link from the base, base axes
        return np.array(torque), (on_base - needed).vector.copy()
