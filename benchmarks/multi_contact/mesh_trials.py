"""Trials whose pushes are at the places of the static ground truth: on the visual meshes, where the skin
differs from the primitives."""

from pathlib import Path

import click
import numpy as np

from contactsense import Scene
from contactsense.benchmarks.multi_contact.trials import Push, Trials
from contactsense.benchmarks.truth_arms import STATIC, file_of


class MeshTrials(Trials):
    """Draws trials on the meshes of one arm."""

    def __init__(self, scene: Scene, seed: int, folder: Path, robot: str) -> None:
        """Read the places and normals of `static_points_ROBOT.npz` in `folder`.

        Raises:
            click.ClickException: the file cannot be read.
        """
        super().__init__(scene, seed)
        path = file_of(folder, STATIC, robot)
        try:
            with np.load(path) as file:
                self._link = file["link"].astype(np.int64)
                self._point, self._normal = file["c_link"], file["n_link"].astype(np.float64)
        except (OSError, ValueError, KeyError) as error:
            raise click.ClickException(f"{path}: cannot read ground truth: {error}") from None

    def _push(self, size: float) -> Push:
        """One push. Whether a part of the arm covers the place in this posture is not looked at."""
        i = int(self._rng.integers(len(self._link)))
        link = int(self._link[i])
        body = self._constants.sensors.depth[link]
        R, o = self._motion.rotation[body], self._motion.origin[body]
        normal = R @ self._normal[i]
        force = self._force(normal, size)
        return Push(link, R @ self._point[i] + o, normal, force, self._torsion(size))
