"""Explanations, the sets of contacts that compete, and their probabilities.

`set_evidence` weighs a joint optimum, `stored_explanations` stores it, `ranked_sets` keeps the best. Pairs
that many places explain are summed (`summed_pairs`) and pooled with the optima (`pooled_evidence`,
`pooled_places`). `set_reduction` adds those that overlap with the answer to it, and `marginal_probabilities`
are those of the single contacts.
"""
