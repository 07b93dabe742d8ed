"""An arm with seven joints, which no UR controller has."""

from pathlib import Path

import yaml

from contactsense import Scene
from tests.robots.urdf.test_read_urdf import arm


def seven_joints(folder: Path) -> Scene:
    """A scene of the arm, also written to `folder` as `seven.yaml`."""
    (folder / "seven.urdf").write_text(arm())
    ball = [{"kind": "sphere", "center": [0.0, 0.0, 0.0], "radius": 0.05}]
    links = {f"link{i}": {"coarse": ball, "fine": ball} for i in range(8)}
    (folder / "seven.surface.yaml").write_text(yaml.safe_dump({"robot": "seven", "links": links}))
    (folder / "seven.yaml").write_text("robot: seven.urdf\n")
    return Scene.load(folder / "seven.yaml")
