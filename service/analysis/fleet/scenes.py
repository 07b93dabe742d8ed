"""Which scene file belongs to which robot of a dataset."""

from collections.abc import Iterable
from pathlib import Path

from contactsense.scene import SceneError
from contactsense.service.analysis.fleet.segments import DatasetFile
from contactsense.service.recordings import RecordingError, scene_in
from contactsense.service.recordings.metadata import scene_text

OWN_SCENE = "scene.yaml"
"""A robot's own scene file, in its folder `robot=NAME`."""


def scene_files(scene: Path | None, files: Iterable[DatasetFile], carried: Path) -> dict[str, Path]:
    """The scene file of each robot.

    Args:
        scene: One file for all robots; or a folder with `NAME.yaml` for each; None: each robot's own, see
            `OWN_SCENE`, or otherwise the one stored in its first recording.
        files: The recordings of the dataset.
        carried: Folder to which the scenes stored in recordings are written.

    Raises:
        SceneError: there is no scene file for a robot; the message names robot and file.
    """
    found: dict[str, Path] = {}
    for file in files:
        if file.robot not in found:
            found[file.robot] = _scene_file(scene, file, carried)
    return found


def _scene_file(scene: Path | None, file: DatasetFile, carried: Path) -> Path:
    if scene is not None and not scene.is_dir():
        return scene.resolve()
    if scene is not None:
        path = scene / f"{file.robot or 'unknown'}.yaml"
    else:
        folder = f"robot={file.robot}"
        path = next((up for up in file.path.parents if up.name == folder), file.path.parent) / OWN_SCENE
    carries = ""
    if not path.is_file() and scene is None:
        try:
            text = scene_text(scene_in(file.path))
            path = carried / f"{file.robot or 'unknown'}.yaml"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except RecordingError as error:
            carries = f"; {error}"
    if not path.is_file():
        raise SceneError(
            f"robot {file.robot or 'unknown'}: expected a scene file {path}, found none; --scene names a "
            f"file for all robots, or a folder with NAME.yaml for each{carries}"
        )
    return path.resolve()
