"""The motion to record for a calibration.

`excitation` searches `fourier_trajectory`s that keep their `clearance` and leave the least
`expected_uncertainty`.
"""
