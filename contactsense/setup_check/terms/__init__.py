"""Recordings as the terms of equations that are linear in what a scene states.

`observed_motion` follows a recording at its `instants`; `joint_terms` and `load_terms` are the terms of joint
torques and of force/torque sensors, `motion_basis` all of them.
"""
