"""Arms from URDF files.

`read_urdf` makes a `Robot` of a `urdf_document` that has been checked; `arm_chain` chooses the joints of the
arm, and `meshes` loads the surfaces of its links.
"""
