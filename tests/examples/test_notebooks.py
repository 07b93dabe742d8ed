"""The notebooks run, cell by cell."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from contactsense.service.analysis.timeline_figure import timeline_figure

pytest.importorskip("matplotlib")
pytest.importorskip("pandas")
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
    assert names["analysis"].plot()._repr_png_().startswith(b"\x89PNG")  # what Jupyter shows
    assert names["estimate"].contacts[0].link == "forearm"


def test_what_a_plot_needs_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install '\.\[notebook\]'"):
        timeline_figure((), SimpleNamespace())  # type: ignore[arg-type]


def test_there_are_notebooks() -> None:
    assert NOTEBOOKS
