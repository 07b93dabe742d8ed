"""Whether readings can be measurements: `plausibility`, `stuck_channels`, `torque_check`, `velocity_check`.

`recent_trouble` puts what is wrong in words.
"""
