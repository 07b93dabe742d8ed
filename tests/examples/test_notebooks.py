"""The notebooks run, cell by cell."""

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")
NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path) -> None:
    names: dict[str, Any] = {}
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec(compile("".join(cell["source"]), f"{path.name}:{cell['id']}", "exec"), names)
    assert len(names["analysis"].contacts) == 8
    assert names["estimate"].contacts[0].link == "forearm"


def test_there_are_notebooks() -> None:
    assert NOTEBOOKS
