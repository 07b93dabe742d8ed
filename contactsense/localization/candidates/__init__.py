"""Candidate contacts, whichever search has found them.

`candidate_buffers` stores them. `surface_tails` widens their covariance (`place_covariance`) where the
primitives deviate from the real surface, `accessibility` weighs whether a place can be touched, by the parts
of its neighbourhood that others cover (`simd_neighbourhood`), and `mixture_reduction` makes one candidate of
those whose places do not differ significantly.
"""
