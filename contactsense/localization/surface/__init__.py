"""The surface on which a contact is sought.

`primitive_frames` and `placed_surface` are the primitives in one posture; `mean_surface` and `local_prior`
tell how the real surface deviates from them. `surface_samples` are points spread over it, in `surface_blocks`
for SIMD instructions (`simd_layout`), and `line_distance` how far parts of it are from the line of action.
`surface_moments` stands for a surface of which only the moments are known.
"""
