"""Docstrings of attributes for `help` and notebooks, which do not show what stands below a field."""

import ast
import functools
import inspect
import itertools
import sys
from typing import TypeVar

C = TypeVar("C", bound=type)


def with_attributes(described: C) -> C:
    """Append the docstrings of a class's fields to the docstring of the class, under `Attributes`.

    Nothing is appended where Python has no source or strips docstrings.
    """
    found: dict[str, str] = {}
    for each in reversed(described.__mro__):
        if each.__module__.startswith("contactsense."):
            found |= _attributes(each.__module__).get(each.__qualname__, {})
    if found and described.__doc__:
        lines = [f"    {name}: {' '.join(text.split())}" for name, text in found.items()]
        described.__doc__ = "\n".join((inspect.cleandoc(described.__doc__), "", "Attributes:", *lines))
    return described


@functools.cache
def _attributes(module: str) -> dict[str, dict[str, str]]:
    """Class -> field -> docstring, of the classes at the top of a module."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {each.name: _docstrings(each.body) for each in tree.body if isinstance(each, ast.ClassDef)}


def _docstrings(body: list[ast.stmt]) -> dict[str, str]:
    """Annotated name -> the text below it."""
    return {
        field.target.id: text.value.value
        for field, text in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }
