"""Signatures: no function with more than ten arguments, and none that opts out of strict typing."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("contactsense", "robots", "kinematics", "service", "benchmarks")
FILES = sorted(
    path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py") if not path.parent.is_symlink()
)
MOST = 10

Function = ast.FunctionDef | ast.AsyncFunctionDef


def _functions(path: Path) -> Iterator[Function]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, Function):
            yield node


def _is_command(function: Function) -> bool:
    """click passes one argument for each option."""
    return any("command" in ast.unparse(decorator) for decorator in function.decorator_list)


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_function_has_more_than_ten_arguments(folder: str) -> None:
    long = []
    for path in (path for path in FILES if path.relative_to(ROOT).parts[0] == folder):
        for function in _functions(path):
            given = function.args
            names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            count = len([name for name in names if name not in ("self", "cls")])
            if count > MOST and not _is_command(function):
                long.append(f"{path.name}: {function.name} has {count}")
    assert not long


def test_every_function_states_its_types() -> None:
    opted_out = [path.name for path in FILES if "no-untyped-def]" in path.read_text(encoding="utf-8")]
    assert FILES
    assert not opted_out
