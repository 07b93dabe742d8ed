"""Endings of the names of files that describe arms and bodies."""

MESH_SUFFIXES = (".ply", ".dae", ".obj", ".stl", ".glb")
"""Those of meshes."""
URDF_SUFFIXES = (".urdf", ".xml", ".xacro", ".sdf")
"""Those of files that are read as URDF; of another format, they are refused with a hint."""
