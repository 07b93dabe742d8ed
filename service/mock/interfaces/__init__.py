"""What a UR controller and an ATI Net F/T sensor offer to clients.

`rtde_server` sends `rtde_fields`, which are those of a recorded motion (`playback_fields`) or of a controller
that obeys commands (`live_fields`), perhaps with `wire_faults`. `dashboard_server` and `client_interfaces`
take commands, `netft_server` is the force/torque sensor. `sent_log` and `received_log` are for measurements
of latency.
"""
