"""Search over the whole surface, where the line of action is not known.

`search` asks `surface_evidence` for the evidence of all cells: a Laplace approximation (`laplace_evidence`,
`cell_equations`) for those that `energy_bound` does not exclude. Clusters of cells become candidates
(`surface_candidate`): a place (`mean_shift`), a force (`force_at_place`) and a region (`ellipse_scale`).
"""
