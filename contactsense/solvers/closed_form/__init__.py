"""The exact contact on bodies of one kind each, with torsion (paper, sections 4 and 7).

`wrench_axis` is the place without torsion. `ellipsoid`, `cylinder`, `plane` and `paraboloid` are the paper's
surfaces; `capsule`, `box`, `revolved` (with `torus_rim`) and `polytope` are rounded bodies, of which exactly
one `patch` contains the contact; `compound` and `fingertip` are composed of parts. `packed_primitive` chooses
the solver of a robot's primitive, and `nearest_point` answers a force that misses the body. Only `torus_rim`
and parts of `nearest_point` iterate.

Sizes, places and wrenches are in the frame in which the surface is described. Units are any of length and
force, the same throughout.
"""
