"""Data that lies beside the project, never in it: ground truth, meshes. Tests skip where it is absent."""

import os
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(os.environ.get("CONTACTSENSE_SHARED", Path(__file__).parents[2] / "shared" / "data"))


def shared(path: str) -> Path:
    """A file or folder of the shared data; skips the test where it is absent."""
    found = FOLDER / path
    if not found.exists():
        pytest.skip(f"{found} is absent; CONTACTSENSE_SHARED names the folder that holds {path}")
    return found


def truth(name: str) -> dict[str, np.ndarray]:
    """Arrays of one ground-truth file; skips the test where it is absent."""
    with np.load(shared(f"truth/{name}")) as data:
        return {key: data[key] for key in data.files}
