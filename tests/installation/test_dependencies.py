"""Whatever is declared is used, by an import or by a name that another library resolves."""

import ast
import functools
import re
from pathlib import Path

import pytest

from tests.installation import ROOT, declared

MODULES = {
    "PyYAML": "yaml",
    "ur-rtde": "rtde_receive",
    "pin": "pinocchio",
    "airo-models": "airo_models",
    "fastapi-offline": "fastapi_offline",
    "prometheus-client": "prometheus_client",
    "mcap-ros2-support": "mcap_ros2",
}
"""Distribution -> the module that it installs, where the names differ."""
NAMED = {
    "httptools": ("service/api/http/connections.py", r"httptools_impl import"),
    "websockets": ("service/api/http/connections.py", r"websockets_sansio_impl import"),
    "dask": ("service/analysis/fleet/worker_pool.py", r"from distributed import"),
    "mpmath": ("benchmarks/solvers/reference.py", r'import_module\("mpmath"\)'),
    "pycollada": ("robots/files/suffixes.py", r'"\.dae"'),
    "rtree": ("benchmarks/accuracy/geometry.py", r"trimesh\.proximity\.closest_point"),
    "fast-simplification": ("service/drawing/visual_meshes.py", r"\.simplify_quadric_decimation"),
    "networkx": ("tests/robots/urdf/test_read_urdf.py", r"\.split\(only_watertight"),
    "example-robot-data": ("tests/robots/urdf/test_read_urdf.py", r'files\("example-robot-data"\)'),
    "pytest-timeout": ("pyproject.toml", r"^timeout = \d+"),
    "pytest-xdist": ("Makefile", r"pytest .*-n auto"),
    "ruff": ("Makefile", r"/ruff check"),
    "mypy": ("Makefile", r"/mypy$"),
    "import-linter": ("Makefile", r"/lint-imports"),
    "types-PyYAML": ("robots/files/yaml_fields.py", r"^import yaml"),
    "scipy-stubs": ("contactsense/detection/false_alarm_rate.py", r"^from scipy"),
}
"""Distribution -> file and text that call for it by a name other than an import."""


@functools.cache
def _sources() -> tuple[str, ...]:
    folders = ("robots", "kinematics", "contactsense", "service", "benchmarks", "tests")
    paths = (path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    return tuple(path.read_text(encoding="utf-8") for path in paths)


@functools.cache
def _imports(source: str) -> frozenset[str]:
    """All modules that a file imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.split(".")[0])
    return frozenset(found)


def _is_imported(module: str) -> bool:
    """Whether some file imports it; parsing all files would take seconds."""
    written = re.compile(rf"^\s*(import|from)\s.*\b{module}\b", re.MULTILINE)
    return any(written.search(source) and module in _imports(source) for source in _sources())


@pytest.mark.parametrize("name", sorted({requirement.name for requirement in declared("*")}))
def test_a_declared_dependency_is_used(name: str) -> None:
    if name in NAMED:
        path, pattern = NAMED[name]
        text = (ROOT / path).read_text(encoding="utf-8")
        assert re.search(pattern, text, re.MULTILINE), f"{path} does not call for {name} any more"
    else:
        assert _is_imported(MODULES.get(name, name)), f"{name} is declared and never imported"


def test_the_tables_name_what_is_declared() -> None:
    names = {requirement.name for requirement in declared("*")}
    assert set(MODULES) | set(NAMED) <= names


def test_constraints_hold_names_and_versions_only() -> None:
    for line in Path(ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", line), line
