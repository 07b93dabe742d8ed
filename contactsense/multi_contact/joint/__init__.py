"""Joint optimization of several contacts: all points, forces and torsions at once.

`initial_contacts` places them, `joint_optimization` minimizes the `joint_energy` of a `joint_problem` by
`contact_step`s, with the derivatives of `contact_linearization` and what is known before as `known_rows`.
`joint_covariance` is the uncertainty of the result.
"""
