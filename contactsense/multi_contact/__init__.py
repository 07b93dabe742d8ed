"""Several simultaneous contacts.

Every sensor value is a sum over the contacts that it measures: the base sensor measures all of them,
joint j those on links distal to it, a sensor within the arm those distal to it. Given the points of
contact, this is linear in forces and torsions. One energy over all forces, torsions and points is
minimized by Gauss-Newton, and sets of one, two and three contacts compete by log evidence.

`contact_set_search` is the whole search. It starts at the seeds that `seeding` chooses by the `likelihood` of
contacts near samples of the surface, optimizes sets of contacts (`joint`) and weighs the optima
(`explanations`). `known_contacts` is what is known of earlier ones, `memory` the arrays of all that.
`locator` does this for one measurement, `tracking` for a stream.
"""
