"""The viewer: the arm, its contacts and what is not known about them, in a browser (extra `viewer`).

A source gives a `frame` at a time: `live_source` of a running service, `recorded_source` of a recording,
`analysis_source` of an analysis. `viewer` draws it: `arm_nodes`, `contact_nodes`, `heat`, and beside them
`force_plot`, `latch_panel`, `view_panel` and the estimate in `words`.
"""

READY = "viewer at "
"""Beginning of the line on stdout with which `contactsense view` names its address."""
