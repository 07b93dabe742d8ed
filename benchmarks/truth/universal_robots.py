"""UR3e and UR5e: frames, limits and visual meshes of `airo-models`, their maker's inertia.

Links 0 to 6 are base, shoulder, upper arm, forearm and three wrists. The base frame is ROS
`base_link_inertia`, the base frame of the controller; those of the others are ROS `<name>_link`.
"""

from pathlib import Path
from xml.etree import ElementTree

import airo_models
import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from .arm import AXIS, Arm, Link
from .urdf import limits, mesh, pose, symmetric

LINKS = ("base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_BASE_MESH = "visual/base.obj"
"""The URDF's own mesh of the base contains a cable, which is no part of the arm."""


def read(name: str) -> Arm:
    """One of the two arms.

    Raises:
        ValueError: a mesh has no facets.
    """
    path = Path(airo_models.get_urdf_path(name))
    # An attribute there has a prefix that no namespace declares.
    urdf = ElementTree.fromstring(path.read_text(encoding="utf-8").replace("drake:", ""))
    found = [urdf.find(f"joint[@name='{joint}_joint']") for joint in JOINTS]
    joints = [joint for joint in found if joint is not None]
    poses = [(np.zeros(3), np.eye(3)), *(pose(joint) for joint in joints)]
    with (Path(__file__).parent / "inertia.yaml").open(encoding="utf-8") as file:
        bodies = yaml.safe_load(file)[name]
    links = []
    for link, (origin, rotation), body in zip(LINKS, poses, bodies, strict=True):
        assert body["link"] == link
        visual = urdf.find(f"link[@name='{link}_link{'_inertia' if link == 'base' else ''}']/visual")
        file_name = _BASE_MESH
        if link != "base" and visual is not None:
            file_name = visual.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
        vertices, faces = mesh(path.parent / file_name)
        shift, turn = pose(visual)
        roll = Rotation.from_euler("x", body["roll"]).as_matrix()
        tensor = roll @ symmetric(*body["tensor"]) @ roll.T
        com = np.array(body["com"], dtype=float)
        vertices = vertices @ turn.T + shift
        links.append(Link(link, origin, rotation, AXIS, vertices, faces, float(body["mass"]), com, tensor))
    return Arm(name, tuple(links), *limits(joints, path), "airo-models")
