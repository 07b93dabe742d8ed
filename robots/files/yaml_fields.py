"""YAML that a user has written: no key twice, errors in words, and numbers that are what they look like; and
YAML that is read so.

PyYAML knows YAML 1.1 only, in which `010` is 8, `1:30` is 90 and `2024-01-01` no text. Here the first is 10
and the others are text, as in YAML 1.2.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from contactsense.robots.files.integers import finite_or_infinite, integer

_TAG = "tag:yaml.org,2002:"
_INTEGER, _FLOAT = f"{_TAG}int", f"{_TAG}float"
_NUMBERS = {
    _INTEGER: r"[-+]?(0b[01_]+|0x[0-9a-fA-F_]+|[0-9][0-9_]*)",
    _FLOAT: r"[-+]?([0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*|[0-9][0-9_]*(?=[eE]))([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}
"""Numbers in other forms are text."""
_FIRST = list("-+.0123456789")
_MOST_REPEATED = 1_000_000
"""So many values may be repeated by aliases. A few lines of them stand for more than any memory holds."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Refuses a key that is given twice, of which YAML would silently use the last one, and a node that
    contains itself."""

    def construct_document(self, node: yaml.Node) -> Any:
        seen: dict[int, int] = {}
        if _size(node, seen) > len(seen) + _MOST_REPEATED:
            raise _error(f"aliases that repeat more than {_MOST_REPEATED} values", node)
        # Completed depth first, no node can be part of itself.
        self.deep_construct = True
        return super().construct_document(node)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, TypeError, LookupError, AttributeError):
            kind = str(node.tag).removeprefix(_TAG)
            got = repr(node.value) if isinstance(node, yaml.ScalarNode) else "several"
            raise _error(f"expected a value of the type {kind}, got {got:.60}", node) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        lines: dict[str, int] = {}
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in lines:
                raise _RepeatedKeyError(
                    f"{key.value}: expected once, got in line {lines[key.value]} and in line {line}"
                )
            lines[key.value] = line
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int | float:
        text = str(node.value).replace("_", "")
        if re.search("[bx]", text):
            return finite_or_infinite(super().construct_yaml_int(node))
        return integer(text)

    yaml_implicit_resolvers = {  # noqa: RUF012 (a name of PyYAML)
        first: [(tag, pattern) for tag, pattern in kinds if tag not in (*_NUMBERS, f"{_TAG}timestamp")]
        for first, kinds in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


class Dumper(yaml.SafeDumper):
    """Writes what is read here and by others: text that either takes for a number is in quotes."""


for _tag, _pattern in _NUMBERS.items():
    for _kind in (_Loader, Dumper):
        _kind.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern})$"), _FIRST)
_Loader.add_constructor(_INTEGER, _Loader.construct_yaml_int)


def _size(node: yaml.Node, seen: dict[int, int]) -> int:
    """Number of nodes that a node stands for, where each alias stands for all that it repeats."""
    if id(node) not in seen:
        seen[id(node)] = 1  # of one that contains itself
        below: list[Any] = [] if isinstance(node, yaml.ScalarNode) else node.value
        if isinstance(node, yaml.MappingNode):
            below = [each for pair in below for each in pair]
        seen[id(node)] += sum(_size(each, seen) for each in below)
    return seen[id(node)]


def _error(what: str, node: yaml.Node) -> yaml.YAMLError:
    return yaml.constructor.ConstructorError(None, None, what, node.start_mark)


class _RepeatedKeyError(Exception):
    pass


def read_yaml(path: str | Path, what: str) -> Any:
    """Content of the YAML file at `path`.

    Args:
        path: The file.
        what: What the file contains, for messages, such as `the scene`.

    Raises:
        ValueError: The file cannot be read, is not YAML, or has a key twice; the message names it.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ValueError(f"{path}: cannot read {what}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: cannot read {what}: expected text in UTF-8") from None
    return _parsed(text, str(path))


def read_fields(path: str | Path, what: str, example: str) -> dict[str, Any]:
    """Fields of the YAML file at `path`.

    Args:
        path: The file.
        what: What the file contains, for messages, such as `the scene`.
        example: A field that it may have, for messages, such as `robot: ur5e`.

    Raises:
        ValueError: The file cannot be read, is not YAML, has no fields, a key that is no name, or one
            twice; the message names it.
    """
    return _fields(read_yaml(path, what), str(path), example)


def fields_in(text: str, name: str, example: str) -> dict[str, Any]:
    """Fields of YAML text.

    Args:
        text: The text.
        name: Where it comes from, for messages.
        example: A field that it may have, for messages.

    Raises:
        ValueError: The text is not YAML, has no fields, a key that is no name, or one twice; the message
            names it.
    """
    return _fields(_parsed(text, name), name, example)


def _parsed(text: str, name: str) -> Any:
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ValueError(f"{name}: not YAML: {' '.join(str(error).split())}") from None
    except _RepeatedKeyError as error:
        raise ValueError(f"{name}: {error}") from None
    except RecursionError:
        raise ValueError(f"{name}: nested too deeply") from None
    except UnicodeEncodeError:
        raise ValueError(f"{name}: expected text in UTF-8") from None


def _fields(content: Any, name: str, example: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        got = "nothing" if content is None else f"{content!r:.40}"
        raise ValueError(f"{name}: expected fields such as `{example}`, got {got}")
    others = [key for key in content if not isinstance(key, str)]
    if others:
        raise ValueError(f"{name}: expected names of fields such as `{example}`, got {others[0]!r:.40}")
    return content
