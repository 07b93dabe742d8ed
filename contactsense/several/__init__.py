"""Several contacts at a time (theory, sections 3 to 5, with stacked contacts).

Every sensor value is a sum over the contacts that it sees: the base sensor sees all of them, joint j those on
links beyond it, a wrist sensor those beyond the wrist. Given the places, all of that is linear in the forces
and torsions. So one contact becomes several by stacking: one energy, one Gauss-Newton search over all forces,
torsions and places together, one scale of evidence on which one, two and three contacts compete.
"""
