"""Ground truth that anybody can make: contacts on the visual meshes of an arm, sensors by MuJoCo.

Nothing of contactsense is imported here, neither its kinematics nor its meshes or primitives: an error of the
estimator's models shows in what is measured with these contacts.
"""

ROBOTS = {"ur3e": "universal_robots", "ur5e": "universal_robots", "panda": "panda"}
"""Arm -> module that reads it."""
