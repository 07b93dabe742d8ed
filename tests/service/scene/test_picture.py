"""The picture of a scene."""

from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot
from matplotlib.text import Annotation

from contactsense import Scene, WrenchSensor
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.picture import draw_scene
from tests.plain_arm import plain_ur5e


@pytest.mark.parametrize("mounting", ["table", "ceiling", "wall"])
def test_names_of_frames_do_not_cover_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mounting: str
) -> None:
    """A sensor just below the base of an arm on the ceiling is above it in the picture."""
    figures: list[Any] = []
    monkeypatch.setattr(pyplot, "close", figures.append)
    sensor = WrenchSensor(translation=(0.1, 0.05, -0.08))
    scene = Scene(robot=plain_ur5e(), mounting=mounting, base_wrench=sensor)
    draw_scene(scene, usual_posture(scene.robot), tmp_path / "scene.png")
    monkeypatch.undo()
    (figure,) = figures
    for plot in figure.axes:
        texts = [text for text in plot.texts if isinstance(text, Annotation) and "frame" in text.get_text()]
        assert [text.get_text() for text in texts] == ["base frame (solid)", "base sensor frame (dashed)"]
        boxes: list[Any] = [text.get_bbox_patch().get_window_extent() for text in texts]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    pyplot.close(figure)
