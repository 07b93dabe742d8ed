"""The smallest force that the sensors detect, as heat on the surface of the arm."""

import threading

import numpy as np
import trimesh
import viser

from contactsense.detection.detectable_force import DETECTION
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.scene import Scene
from contactsense.scene_model.constants import build_constants
from contactsense.service.drawing.link_geometry import link_meshes
from contactsense.service.drawing.palette import heat_colours, heat_scale
from contactsense.service.scene.summary import link_places
from contactsense.service.viewer.arm_nodes import link_node
from contactsense.surface_map.sensor_response import sensor_response
from contactsense.surface_map.smallest_force import detected_size, smallest_force

INTERVAL = 0.5
"""Shortest time between two postures that are computed [s]."""
MOVED = 0.02
"""A joint that has turned by less does not change the picture [rad]."""


class Heat:
    """Computes and draws the heat in a thread, while it is shown; the arm moves on meanwhile."""

    def __init__(self, nodes: viser.SceneApi, scene: Scene) -> None:
        """Nothing is computed before `show`."""
        self._nodes, self._scene = nodes, scene
        self._q = np.zeros(len(scene.robot.joints))
        self._shown = threading.Event()
        self._over = threading.Event()
        self._legend = ""
        self.drawn = False
        """Whether the heat is to be seen."""
        self._handles: list[viser.GlbHandle] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="heat", daemon=True)
        self._thread.start()

    @property
    def legend(self) -> str:
        """What the colours mean, in one sentence; empty while heat is not shown."""
        if not self._shown.is_set():
            return ""
        return self._legend or "The detectable forces are being computed."

    def show(self, visible: bool) -> None:
        """Show or hide the heat."""
        with self._lock:
            if visible:
                self._shown.set()
            else:
                self._shown.clear()
                self._remove()

    def move(self, q: np.ndarray) -> None:
        """Set the posture (n,) [rad]."""
        self._q = q.copy()

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        self._shown.set()
        self._thread.join()

    def _run(self) -> None:
        constants = meshes = drawn = None
        size = 0.0
        while not self._over.wait(0.0 if drawn is None else INTERVAL):
            self._shown.wait()
            if self._over.is_set():
                return
            if constants is None or meshes is None:
                constants, size = build_constants(self._scene), detected_size(self._scene, DETECTION)
                links = link_meshes(self._scene, pedestals=True)
                meshes = [trimesh.Trimesh(link.vertices, link.faces, process=False) for link in links]
            q = self._q
            if self._handles and drawn is not None and np.abs(q - drawn).max() < MOVED:
                continue
            motion = empty_motion(len(q))
            forward_kinematics(constants.model, q, motion)
            response = sensor_response(self._scene, constants, motion)
            forces, poses = [], link_places(self._scene, q)
            for i, mesh in enumerate(meshes):
                turn, origin = poses[i, :3, :3], poses[i, :3, 3]
                points, normals = mesh.vertices @ turn.T + origin, mesh.vertex_normals @ turn.T
                each = np.broadcast_to(response[i], (len(points), *response[i].shape))
                forces.append(smallest_force(each, size, points, normals))
            self._draw(meshes, forces)
            drawn = q

    def _draw(self, meshes: list[trimesh.Trimesh], forces: list[np.ndarray]) -> None:
        found = np.concatenate(forces)
        low, high = heat_scale(found)
        colours = heat_colours(found, low, high)
        begin = 0
        with self._lock:
            if not self._shown.is_set():
                return
            self._remove()
            for i, mesh in enumerate(meshes):
                part = colours[begin : begin + len(mesh.vertices)]
                begin += len(mesh.vertices)
                if len(mesh.faces):
                    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=part)
                    self._handles.append(self._nodes.add_mesh_trimesh(f"{link_node(i)}/heat", mesh))
            self.drawn = True
            self._legend = (
                f"Smallest push that one measurement detects: {low:.1f} N (bright) to {high:.1f} N (dark); "
                "grey: larger."
                if np.isfinite(found).any()
                else "No push is sure to be detected."
            )

    def _remove(self) -> None:
        self.drawn = False
        for handle in self._handles:
            handle.remove()
        self._handles = []
