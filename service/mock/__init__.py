"""A simulated arm with sensors, served over the real protocols.

The `interfaces` are those of a UR controller and of a force/torque sensor. `servers` plays through them a
motion that is computed beforehand (`playback` of a simulated `arm`). `live_servers` obeys commands: the
`controller` moves an arm by `physics` each millisecond, and executes programs in `urscript`.
"""

READY = "mock arm at "
"""Beginning of the line on stdout with which `contactsense mock` names its addresses."""
