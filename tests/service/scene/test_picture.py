"""The picture of a scene."""

from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot
from matplotlib.text import Annotation

from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.picture import draw_scene
from tests.plain_arm import plain_ur5e

INNER = [LinkWrenchSensor(name="first", link="forearm"), LinkWrenchSensor(name="second", link="wrist_1")]
SENSORS = {"wrist_wrench": WrenchSensor(), "link_wrenches": INNER, "tool": {"name": "gripper", "mass": 1.0}}
SENSOR = WrenchSensor(translation=(0.1, 0.05, -0.08))


@pytest.mark.parametrize("further", [{}, SENSORS])
@pytest.mark.parametrize("mounting", ["table", "ceiling", "wall"])
def test_names_of_frames_cover_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mounting: str, further: dict[str, Any]
) -> None:
    """They are beside the arm, and the lines to their frames do not cross."""
    figures: list[Any] = []
    monkeypatch.setattr(pyplot, "close", figures.append)
    scene = Scene(robot=plain_ur5e(), mounting=mounting, base_wrench=SENSOR, **further)
    draw_scene(scene, usual_posture(scene.robot), tmp_path / "scene.png")
    monkeypatch.undo()
    (figure,) = figures
    names = ["base frame (solid)", "base sensor frame (dashed)"]
    if further:
        names += [f"{name} sensor frame (dashed)" for name in ("first", "second", "wrist")]
    for plot in figure.axes:
        texts = [text for text in plot.texts if isinstance(text, Annotation) and "frame" in text.get_text()]
        assert [text.get_text() for text in texts] == names
        boxes: list[Any] = [text.get_bbox_patch().get_window_extent() for text in texts]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        arm = plot.dataLim.transformed(plot.transData)
        letters = [text.get_window_extent() for text in plot.texts if text.get_text() in {*"xyz", "gravity"}]
        assert len(letters) == 3 * len(names) + 1
        assert not any(a.overlaps(b) for a in boxes for b in (arm, *letters))
        assert all(box.x0 > 0.0 and box.x1 < figure.bbox.x1 for box in boxes)
        heights = [
            (plot.transData.transform(text.xy)[1], box.y0) for text, box in zip(texts, boxes, strict=True)
        ]
        assert [box for _, box in sorted(heights)] == sorted(box for _, box in heights)
    pyplot.close(figure)
