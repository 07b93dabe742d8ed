"""Which scene file belongs to which robot of a dataset."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from contactsense.robots.files.whole_file import write_text
from contactsense.scene import Scene, SceneError
from contactsense.service.analysis.fleet.named_within import named_within
from contactsense.service.analysis.fleet.segments import DatasetFile
from contactsense.service.recordings import RecordingError, scene_in
from contactsense.service.recordings.metadata import scene_text

OWN_SCENE = "scene.yaml"
"""A robot's own scene file, in its folder `robot=NAME`."""


@dataclass
class RobotScenes:
    """The scenes of a dataset's robots."""

    paths: dict[str, Path] = field(default_factory=dict)
    """The scene file of each robot that has one."""
    loaded: dict[str, Scene] = field(default_factory=dict)
    """The scene in it."""
    carried: dict[str, str] = field(default_factory=dict)
    """Name of the recording that carries it, where a recording does."""
    missing: dict[str, str] = field(default_factory=dict)
    """Why each of the others has none: one sentence that names robot and file."""


def robot_scenes(scene: Path | None, files: Iterable[DatasetFile], carried: Path) -> RobotScenes:
    """The scene of each robot.

    Args:
        scene: One file for all robots; or a folder with `NAME.yaml` for each; None: each robot's own, see
            `OWN_SCENE`, or otherwise the one stored in the first of its recordings that can be read and
            carries one.
        files: The recordings of the dataset.
        carried: Folder to which the scenes stored in recordings are written.

    Raises:
        SceneError: The file for all robots cannot be used, or no robot has one that can.
    """
    own: dict[str, list[DatasetFile]] = {}
    for file in files:
        own.setdefault(file.robot, []).append(file)
    if scene is not None and not scene.is_dir():
        one = Scene.load(scene)
        return RobotScenes(dict.fromkeys(own, scene.resolve()), dict.fromkeys(own, one))
    found = RobotScenes()
    for robot, recordings in own.items():
        try:
            path, carrier = _scene_file(scene, recordings, carried)
            found.loaded[robot] = Scene.load(path)
            found.paths[robot] = path.resolve()
            if carrier is not None:
                found.carried[robot] = carrier.name
        except SceneError as error:
            found.missing[robot] = f"robot {robot}: {error}"
    if not found.paths:
        raise SceneError(next(iter(found.missing.values())))
    return found


def _scene_file(
    scene: Path | None, recordings: list[DatasetFile], carried: Path
) -> tuple[Path, DatasetFile | None]:
    """The scene file of the robot of these recordings, and the one that carries it, if one does; raises a
    SceneError if there is none."""
    first = recordings[0]
    name = f"{first.robot}.yaml"
    carrier = None
    if scene is not None:
        path, reason = scene / name, ""
    else:
        folder = f"robot={first.robot}"
        path = next((up for up in first.path.parents if up.name == folder), first.path.parent) / OWN_SCENE
        if not path.is_file():
            carrier, text, reason = _carried_scene(recordings)
            if carrier is not None:
                path = carried / name
                path.parent.mkdir(parents=True, exist_ok=True)
                write_text(path, text)
    if not path.is_file():
        raise SceneError(
            f"expected a scene file {path}, found none; --scene names a file for all robots, or a folder "
            f"with NAME.yaml for each{reason}"
        )
    return path, carrier


def _carried_scene(recordings: list[DatasetFile]) -> tuple[DatasetFile | None, str, str]:
    """The first of these recordings that carries a scene, and the scene as text; None, and the reason of the
    first one, if there is none."""
    reason = ""
    for file in recordings:
        try:
            return file, scene_text(scene_in(file.path)), ""
        except RecordingError as error:
            reason = reason or f"; {named_within(str(error), file.path, file.name)}"
    return None, "", reason
