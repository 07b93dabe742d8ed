"""Sensor sources: live clients and the alignment of their streams.

`live_source` joins all. The robot is read by `rtde_client` or `ur_rtde_client` (both are a `robot_stream`), a
force/torque sensor of its own by `netft_client`; `network_wrench` brings its readings to the robot's instants
with `time_alignment`. `signal_mapping` makes a `Sample` of them. `plausibility`, `stuck_channels` and
`velocity_check` look for readings that cannot be true, and `source_health` is the result for the operator.
"""
