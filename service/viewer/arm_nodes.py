"""The arm as nodes of a viser scene: links that forward kinematics moves, frames, gravity."""

from collections.abc import Sequence

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from contactsense.scene import Scene
from contactsense.service.drawing.link_geometry import Mesh, link_meshes
from contactsense.service.drawing.palette import link_colour, probability_colour, rgb
from contactsense.service.scene.summary import link_places

BASE = "/arm"
"""The base frame, in a world whose z points up."""
LEAST = 1e-6
"""Change of a link's pose in the link before it that is drawn [1, m]."""


def link_node(index: int) -> str:
    """Name of the node that has the pose of a link: within that of the link before it, so that a joint moves
    all that it carries with one message."""
    return "/".join((BASE, *(f"link {i}" for i in range(index + 1))))


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) as w, x, y, z, shape (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


class ArmNodes:
    """Draws an arm and moves it. `reach` [m] is the scale of the picture."""

    def __init__(self, nodes: viser.SceneApi, scene: Scene) -> None:
        """Add the nodes; no joint is known yet, so the arm is straight."""
        self._scene = scene
        joints = scene.robot.joints
        self.reach = float(sum(np.linalg.norm(joint.translation) for joint in joints))
        self._base = nodes.add_frame(BASE, show_axes=False)
        self._links = [nodes.add_frame(link_node(i), show_axes=False) for i in range(len(scene.link_names))]
        self._skins = {
            visual: [
                _add(nodes, f"{link_node(i)}/{'mesh' if visual else 'primitives'}", mesh, i)
                for i, mesh in enumerate(_meshes(scene, visual))
            ]
            for visual in (True, False)
        }
        self.poses = np.tile(np.eye(4), (len(scene.link_names), 1, 1))
        """Poses of the links in the base frame, that of a tool being the flange, shape (links, 4, 4)."""
        self._q: np.ndarray | None = None
        self._steps = np.full_like(self.poses, np.inf)
        """Poses as drawn, each in the link before it."""
        size = 0.12 * self.reach
        self._frames = [
            nodes.add_frame(f"{BASE}/base frame", axes_length=size, axes_radius=0.04 * size),
            nodes.add_frame(f"{BASE}/sensor frame", axes_length=size, axes_radius=0.04 * size),
            nodes.add_frame(
                f"{link_node(len(joints))}/tool frame",
                axes_length=size,
                axes_radius=0.04 * size,
                wxyz=quaternion(scene.robot.flange_rotation),
                position=scene.robot.flange_translation,
            ),
        ]
        self._labels = [
            nodes.add_label(f"{frame.name}/name", text, anchor="top-left")
            for frame, text in zip(self._frames, ("base", "base sensor", "tool flange"), strict=True)
        ]
        nodes.add_grid(
            f"{BASE}/mounting surface", 2.0 * self.reach, 2.0 * self.reach, cell_size=0.1, section_size=0.5,
            cell_color=(165, 165, 165), section_color=(125, 125, 125), plane_opacity=0.0,
        )  # fmt: skip
        top = np.array([-0.55, -0.55, 0.35]) * self.reach
        self.gravity = np.array([top, top - [0.0, 0.0, 0.25 * self.reach]])
        """Ends of the arrow that shows gravity, shape (2, 3), world frame [m]."""
        nodes.add_arrows(
            "/gravity", self.gravity[None], (128, 128, 128),
            shaft_radius=0.008 * self.reach, head_radius=0.02 * self.reach, head_length=0.05 * self.reach,
        )  # fmt: skip
        nodes.add_label("/gravity/name", "gravity", position=top)
        self.mount_as(scene)
        self.show_frames(False)
        self.show_meshes(True)

    def move(self, q: np.ndarray) -> None:
        """Give the links their poses at joint positions `q` (n,) [rad]."""
        if self._q is not None and np.array_equal(q, self._q):
            return
        self._q = q.copy()
        self.poses[:] = link_places(self._scene, q)
        steps = self.poses.copy()
        steps[1:] = np.linalg.inv(self.poses[:-1]) @ self.poses[1:]
        change = np.abs(steps - self._steps)
        turned = np.flatnonzero(change[:, :3, :3].max(axis=(1, 2)) > LEAST)
        for i, orientation in zip(turned, quaternion(steps[turned, :3, :3]), strict=True):
            self._links[i].wxyz = orientation
        for i in np.flatnonzero(change[:, :3, 3].max(axis=1) > LEAST):
            self._links[i].position = steps[i, :3, 3]
        self._steps = np.where(change > LEAST, steps, self._steps)

    def mount_as(self, scene: Scene) -> None:
        """Turn the base frame and place the frame of the sensor under it as a scene says."""
        self.mount(scene.orientation)
        sensor = scene.base_wrench
        if sensor is not None:
            self.place_sensor(np.array(sensor.translation), sensor.rotation)

    def mount(self, orientation: Rotation) -> None:
        """Turn the base frame in the world."""
        self._base.wxyz = orientation.as_quat(scalar_first=True)

    def place_sensor(self, translation: np.ndarray, rotation: np.ndarray) -> None:
        """Move the frame of the sensor under the base: origin (3,) [m] and orientation (3, 3) in the base
        frame."""
        frame = self._frames[1]
        frame.position, frame.wxyz = translation, quaternion(rotation)

    def show_frames(self, visible: bool) -> None:
        """Show or hide the frames of base, sensor and tool flange."""
        for i, (frame, label) in enumerate(zip(self._frames, self._labels, strict=True)):
            frame.visible = label.visible = visible and (i != 1 or self._scene.base_wrench is not None)

    def show_meshes(self, visual: bool) -> None:
        """Show the arm's meshes, where there are any, or its primitives."""
        for kind, skin in self._skins.items():
            for mesh in skin:
                mesh.visible = kind == visual
        self._hidden = False

    def hide(self) -> None:
        """Hide the surface; the links' nodes remain."""
        if self._hidden:
            return
        self._hidden = True
        for skin in self._skins.values():
            for mesh in skin:
                mesh.visible = False

    def colour(self, probability: Sequence[float] | None) -> None:
        """Colour the links by the probability of being touched (links,); None: each has its own colour."""
        for skin in self._skins.values():
            for i, mesh in enumerate(skin):
                colour = rgb(link_colour(i) if probability is None else probability_colour(probability[i]))
                if tuple(mesh.color) != tuple(colour):
                    mesh.color = colour


def _meshes(scene: Scene, visual: bool) -> tuple[Mesh, ...]:
    try:
        return link_meshes(scene, visual, pedestals=True)
    except ImportError:  # without the extra `geometry`
        return link_meshes(scene, pedestals=True)


def _add(nodes: viser.SceneApi, name: str, mesh: Mesh, index: int) -> viser.MeshHandle:
    return nodes.add_mesh_simple(name, mesh.vertices, mesh.faces, color=rgb(link_colour(index)))
