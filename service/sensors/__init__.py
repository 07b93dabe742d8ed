"""Sensor sources: live clients and the alignment of their streams.

`live_source` joins all: the `clients` read the robot and the force/torque sensors, `network_wrench` brings a
sensor's readings to the robot's instants with `time_alignment`, and `signal_mapping` makes a `Sample` of
them. `checks` look for readings that cannot be true, and `source_health` is the result for the operator.
"""
