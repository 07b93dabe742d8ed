"""Forces of a contact whose place is known from all of its samples, where only joint torques are measured.

A base sensor measures the force itself. Joint torques do not: the force that a live estimate states belongs
to its own link and place, and at another place it may even pull on the surface. So the force of each sample
is the most probable one at the place that is stated, which is free within its covariance.
"""

from dataclasses import replace

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, empty_motion
from contactsense.localization.surface.simd_layout import LENGTH
from contactsense.localization.surface_search.force_at_place import FIXED_SPREAD, forces_at_places
from contactsense.runtime.result_rows import FORCE, LINK, TORSION
from contactsense.scene_model.constants import Constants
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact


def with_forces_at_place(
    history: ContactHistory, smoothed: SmoothedContact, model: Model, constants: Constants
) -> ContactHistory:
    """The contact with link, force and torsion of each explanation from the torques and the place of
    `smoothed`; the other numbers of its `rows` remain those of the live estimates.

    Args:
        history: The contact.
        smoothed: Its estimate from all samples.
        model: Kinematics of the arm.
        constants: Of its localizer.
    """
    n, K = history.block.q.shape[1], len(history.sample)
    motion, body = empty_motion(n), int(constants.sensors.depth[smoothed.best.link])
    points, normals, covariance = smoothed.at(history.t[history.sample])
    across = np.einsum("ki,kij,kj->k", normals, covariance, normals)
    spread = np.sqrt(np.maximum(0.5 * (np.einsum("kii->k", covariance) - across), FIXED_SPREAD**2))
    screws = np.zeros((K, n, 6))
    for k, q in enumerate(history.block.q[history.sample]):
        forward_kinematics(model, q, motion)
        points[k] = motion.origin[body] + motion.rotation[body] @ points[k]
        normals[k] = motion.rotation[body] @ normals[k]
        screws[k, :body] = motion.screw[:body]
    std = history.joint_torque_std[history.sample]
    rows = screws / std[:, :, None]
    torque = history.joint_torque[history.sample] / std
    wrench = np.einsum("kij,kj->ki", np.linalg.pinv(rows), torque)
    information = np.ascontiguousarray(np.swapaxes(rows, 1, 2) @ rows)
    force, torsion = np.zeros((K, 3)), np.zeros(K)
    forces_at_places(
        wrench, information, constants.prior, (points, normals, spread), np.zeros(LENGTH), force, torsion
    )
    found = history.rows.copy()
    found[:, LINK], found[:, FORCE], found[:, TORSION] = smoothed.best.link, force, torsion
    return replace(history, rows=found)
