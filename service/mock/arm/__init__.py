"""The simulated arm: its script, its cell, and the readings of its sensors along a motion that is prescribed.

`script` describes motion, contacts and `obstacles`, `cell` the arm with its mounting and sensors.
`simulated_arm` computes readings and ground truth by `newton_euler`.
"""
