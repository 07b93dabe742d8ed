"""Several contacts in a live stream.

`tracker` decides with each sample whether a further contact has started (`further_contact_test`), and filters
the sets that compete over time (`multi_hypothesis_filter`). `tracked_contacts` are carried from sample to
sample.
"""
