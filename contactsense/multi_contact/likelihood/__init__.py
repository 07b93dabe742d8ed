"""Likelihood of contacts near samples of the surface, whose forces are eliminated.

`link_information` is what a measurement tells of one more contact on each link, `sample_likelihood` uses it
for contacts near samples, `pair_likelihood` for all pairs of samples. `pair_places` and `pair_wrench` are
places and wrenches of the pairs on two links, by the sum over their samples.
"""
