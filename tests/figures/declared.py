"""declared.yaml: where the figures come from that no output in docs shows."""

import ast
import math
import operator
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

from tests.figures.prose import Figure, figures, is_rounding

DECLARED = Path(__file__).with_name("declared.yaml")
_SCALES = {"%": 100.0, "mm": 1e3, "cm": 100.0, "µm": 1e6, "ms": 1e3, "µs": 1e6, "us": 1e6, "MB": 1e-6}
"""Units of a figure in those of code: shares, m, s, bytes."""
_NUMBER = re.compile(r"(?<![\w.])\d[\d_]*(?:\.\d+)?(?:e-?\d+)?(?![\w.]*\w)")
_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}


class Declaration(NamedTuple):
    """Source of the figures of a text."""

    page: str
    text: str
    kind: str
    """`command`, `file`, `is` or `source`."""
    source: str | list[str]


def read_declared(path: Path = DECLARED) -> list[Declaration]:
    """All declarations of a file."""
    pages = yaml.safe_load(path.read_text(encoding="utf-8"))
    return list(_declarations(pages))


def _declarations(pages: dict[str, list[dict[str, str | list[str]]]]) -> Iterator[Declaration]:
    for page, entries in pages.items():
        for entry in entries:
            text = str(entry["text"])
            (kind,) = set(entry) - {"text"}
            yield Declaration(page, text, kind, entry[kind])


def stands_in(figure: Figure, code: str) -> bool:
    """Whether a figure stands in code, in its own unit or in SI units."""
    wanted = (figure.value, figure.value / _SCALES.get(figure.unit, 1.0))
    numbers = [float(number) for number in _NUMBER.findall(code)]
    return any(math.isclose(number, one, rel_tol=1e-9) for number in numbers for one in wanted)


def reckoned(formula: str) -> float:
    """Value of a formula of + - * / and sqrt."""

    def evaluate(node: ast.expr) -> float:
        if isinstance(node, ast.Constant):
            return float(node.value)
        if isinstance(node, ast.BinOp):
            return _OPERATORS[type(node.op)](evaluate(node.left), evaluate(node.right))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "sqrt":
            return math.sqrt(evaluate(node.args[0]))
        raise ValueError(f"not allowed: {ast.unparse(node)}")

    return evaluate(ast.parse(str(formula), mode="eval").body)


def numbers_of(formulas: Sequence[str]) -> set[str]:
    """The numbers that formulas take from outputs or prose: all but 1 and 100."""
    return set(re.findall(r"\d+(?:\.\d+)?", " ".join(map(str, formulas)))) - {"1", "100"}


def wrong_formulas(declaration: Declaration) -> list[str]:
    """Formulas of an `is` that are not the figures of its text, one for each."""
    found = list(figures(declaration.text))
    if len(found) != len(declaration.source):
        return [f"{len(found)} figures, {len(declaration.source)} formulas"]
    return [
        f"{figure.text} {figure.unit} is not {formula}"
        for figure, formula in zip(found, declaration.source, strict=True)
        if not is_rounding(figure, reckoned(formula))
    ]
