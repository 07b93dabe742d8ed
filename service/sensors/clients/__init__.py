"""Clients of the robot and of Net F/T sensors: `rtde_client` or `ur_rtde_client`, and `netft_client`.

Both clients of the robot give a `robot_stream`.
"""
