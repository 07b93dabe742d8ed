"""Where the search for several contacts starts: the sets of samples that explain a measurement best.

`seed_search` chooses them, by way of `pair_seeding` for two contacts; `seed_list` keeps the best.
`seeding_prior` is what known contacts tell before a further one is sought.
"""
