"""The panel for how the arm is drawn, and for trying another mounting or sensor frame."""

from typing import Literal

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from contactsense.scene import Scene
from contactsense.service.viewer.arm_nodes import ArmNodes
from contactsense.service.viewer.controls import set_value
from contactsense.service.viewer.heat import Heat

Colour = Literal["link", "probability", "detectable force"]
COLOURS: tuple[Colour, ...] = ("link", "probability", "detectable force")
"""What the colour of the surface can show."""


class ViewPanel:
    """Controls of the drawing; they are the same for all who look."""

    def __init__(self, gui: viser.GuiApi, arm: ArmNodes, heat: Heat) -> None:
        """Add the controls."""
        self._arm, self._heat = arm, heat
        with gui.add_folder("View"):
            self._meshes = gui.add_checkbox(
                "Meshes", True, hint="The arm's meshes where there are any; otherwise the primitives."
            )
            self._colour = gui.add_dropdown("Colour", COLOURS, initial_value="link")
            self._frames = gui.add_checkbox("Frames", False, hint="Axes of base, base sensor, tool flange.")
            self._legend = gui.add_markdown("", visible=False)
        for control in (self._meshes, self._colour):
            control.on_update(lambda _: self._apply())
        self._frames.on_update(lambda _: arm.show_frames(self._frames.value))

    @property
    def by_probability(self) -> bool:
        """Whether links are coloured by their probability of being touched."""
        return self._colour.value == "probability"

    def update(self) -> None:
        """Show what the colours mean, and no other surface where the heat is."""
        if self._heat.drawn:
            self._arm.hide()
        legend = "Darker: more probably touched." if self.by_probability else self._heat.legend
        if self._legend.content != legend:
            self._legend.content, self._legend.visible = legend, bool(legend)

    def _apply(self) -> None:
        self._heat.show(self._colour.value == "detectable force")
        self._arm.show_meshes(self._meshes.value)
        if self._colour.value == "link":
            self._arm.colour(None)


class MountingPanel:
    """Shows the arm with another mounting or sensor frame at once, and the lines for the scene file."""

    def __init__(self, gui: viser.GuiApi, arm: ArmNodes, scene: Scene) -> None:
        """Add the controls, with the scene's values."""
        self._arm, self._scene = arm, scene
        sensor = scene.base_wrench
        self._given = {
            "mounting": tuple(np.degrees(scene.mounting_rpy).round(3)),
            "rpy": tuple(np.degrees(sensor.rpy).round(3)) if sensor else (0.0, 0.0, 0.0),
            "translation": tuple(np.multiply(1e3, sensor.translation)) if sensor else (0.0, 0.0, 0.0),
        }
        with gui.add_folder("Try another mounting", expand_by_default=False):
            self._mounting = gui.add_vector3("Base, deg", self._given["mounting"], step=5.0)
            self._rpy = gui.add_vector3("Sensor, deg", self._given["rpy"], step=5.0)
            self._translation = gui.add_vector3("Sensor, mm", self._given["translation"], step=5.0)
            self._lines = gui.add_markdown("", visible=False)
            back = gui.add_button("Back to the scene")
        for control in (self._rpy, self._translation):
            control.visible = sensor is not None
        for control in (self._mounting, self._rpy, self._translation):
            control.on_update(lambda _: self._apply())
        back.on_click(lambda _: self._reset())

    def _reset(self) -> None:
        set_value(self._mounting, self._given["mounting"])
        set_value(self._rpy, self._given["rpy"])
        set_value(self._translation, self._given["translation"])
        self._apply()

    def _apply(self) -> None:
        changed = (self._mounting.value, self._rpy.value, self._translation.value) != (
            self._given["mounting"], self._given["rpy"], self._given["translation"],
        )  # fmt: skip
        self._lines.visible = changed
        if not changed:  # the numbers of the panel are rounded
            self._arm.mount_as(self._scene)
            return
        mounting, rpy = np.radians(self._mounting.value), np.radians(self._rpy.value)
        translation = 1e-3 * np.array(self._translation.value)
        self._arm.mount(Rotation.from_euler("xyz", mounting))
        self._arm.place_sensor(translation, Rotation.from_euler("xyz", rpy).as_matrix())
        self._lines.content = scene_lines(mounting, rpy, translation, self._scene.base_wrench is not None)


def scene_lines(mounting: np.ndarray, rpy: np.ndarray, translation: np.ndarray, sensor: bool) -> str:
    """Markdown with the lines of a scene file for a mounting (3,) [rad] and a sensor's frame (3,) [rad], (3,)
    [m]."""

    def numbers(values: np.ndarray) -> str:
        return ", ".join(f"{value + 0.0:.4g}" for value in values)

    lines = [f"mounting: [{numbers(mounting)}]"]
    if sensor:
        lines += ["base_wrench:", f"  rpy: [{numbers(rpy)}]", f"  translation: [{numbers(translation)}]"]
    return "Only drawn; the estimates keep the scene. In its file:\n\n```yaml\n" + "\n".join(lines) + "\n```"
