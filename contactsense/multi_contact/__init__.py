"""Several simultaneous contacts.

Every sensor value is a sum over the contacts that it measures: the base sensor measures all of them,
joint j those on links distal to it, a sensor within the arm those distal to it. Given the points of
contact, this is linear in forces and torsions. One energy over all forces, torsions and points is
minimized by Gauss-Newton, and sets of one, two and three contacts compete by log evidence.
"""
