"""Smoothing of a contact after its end: link and place from all of its samples together.

`contact_smoothing` searches the most probable path on each link (`place_search`, `path_elimination`), on the
skin where the scene asks for it (`skin_constraint`); `torque_smoothing` does without a base sensor. Both give
a `smoothed_contact`.
"""
