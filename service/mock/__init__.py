"""A simulated arm with sensors, served over the real protocols.

Two mocks share the `rtde_server` and the `netft_server`. `servers` plays a motion that is computed beforehand
(`script`, `simulated_arm` with `newton_euler`, `playback`). `live_servers` obeys commands: `robot_controller`
steps the arm of `physics` each millisecond, `program_runner` executes `urscript`, and `dashboard_server` and
`client_interfaces` receive commands.
"""
