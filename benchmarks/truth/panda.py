"""The Panda with its hand: frames, limits, inertia and visual meshes of `example-robot-data`.

Links 0 to 7 are `panda_link0` to `panda_link7`. The last one carries hand and fingers, which are closed.
"""

from importlib import metadata
from pathlib import Path

from . import urdf_arm
from .arm import Arm

_PACKAGE = "example-robot-data"


def read(name: str) -> Arm:
    """The arm.

    Raises:
        ImportError: the package is not installed.
        ValueError: a mesh has no facets.
    """
    try:
        files = metadata.files(_PACKAGE) or []
    except metadata.PackageNotFoundError:
        raise ImportError(
            f"{_PACKAGE} cannot be imported: pip install '.[panda]' in the folder of the sources"
        ) from None
    path = next(Path(str(file.locate())) for file in files if file.name == "panda.urdf")
    return urdf_arm.read(path.resolve(), name=name, package=_PACKAGE)
