"""Several simultaneous contacts.

Every sensor value is a sum over the contacts that it measures: the base sensor measures all of them,
joint j those on links distal to it, a sensor within the arm those distal to it. Given the points of
contact, this is linear in forces and torsions. One energy over all forces, torsions and points is
minimized by Gauss-Newton, and sets of one, two and three contacts compete by log evidence.

`contact_set_search` is the whole search: `seeding` chooses where it begins (`pair_seeding`: all pairs),
`joint_optimization` minimizes `joint_energy`, `set_evidence` weighs the optimum, `ranked_sets` keeps the
best. What is known of earlier contacts enters as `known_rows` and `known_prior`, or, where it is broad, as
`known_place_mixture`. Pairs that many places explain are summed (`pair_likelihood`, `summed_pairs`), and
pooled with the optima (`pooled_evidence`). `locator` does this for one measurement, `tracker` for a stream;
`set_reduction` adds those that overlap with the answer to it, before they are reported.
"""
