"""Localization: the point on the surface of each link at which a wrench acts, and its probability.

`ranking` calls the search of each link and compares all candidates. Where the line of action is known, it is
`line_of_action_search`: one posterior mode on every primitive near the line. Where it is not, it is
`surface_search`: `surface_samples` packed in `surface_blocks`, their `surface_evidence`, and clusters of them
as candidates (`surface_candidate`). Both correct for the real surface (`mean_surface`, `local_prior`) and ask
whether a place can be touched (`accessibility`). `mixture_reduction` makes one candidate of those whose
places do not differ significantly. `intrinsic_contact` is the paper's closed form instead.
"""
