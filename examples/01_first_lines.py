"""Locate one push on an arm at rest. Run it: python examples/01_first_lines.py

The very first run compiles the kernels, which takes one or two minutes; a bar shows how far it is.
"""

import numpy as np

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor

# The scene describes the arm, how it is mounted, and how noisy its sensors are (standard deviations).
scene = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
    joint_torque=JointTorqueSensor(noise=1.0),
)
localizer = Localizer(scene)

# 20 N on the forearm. `external=True`, the default: the arm's own weight has been subtracted already.
estimate = localizer.locate(
    q=np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0]),
    base_wrench=np.array([5.88, 2.35, -18.97, -1.13, -2.26, -0.63]),
    joint_torque=np.array([0.63, -3.22, -3.47, 0.0, 0.0, 0.0]),
)

# "none": noise alone explains it; "contact": one clear answer; "ambiguous": several, with probabilities.
print(f"status: {estimate.status}")
for contact in estimate.contacts:
    spread = 1e3 * np.sqrt(np.trace(contact.covariance))
    print(
        f"{contact.probability:5.1%} on {contact.link}: "
        f"at {np.round(contact.point_base, 3)} m (base frame), +- {spread:.0f} mm, "
        f"force {np.round(contact.force_base, 1)} N"
    )
