"""YAML that a user has written: no key twice, errors in words, and numbers that are what they look like.

PyYAML knows YAML 1.1 only, in which `010` is 8 and `1:30` is 90. Here the first is 10 and the second text, as
in YAML 1.2.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from contactsense.robots.files.integers import integer

_INTEGER, _FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
_NUMBERS = {
    _INTEGER: r"[-+]?(0b[01_]+|0x[0-9a-fA-F_]+|[0-9][0-9_]*)",
    _FLOAT: r"[-+]?([0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*|[0-9][0-9_]*(?=[eE]))([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}
"""Numbers in other forms are text."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Refuses a key that is given twice, of which YAML would silently use the last one, and a node that
    contains itself."""

    def construct_document(self, node: yaml.Node) -> Any:
        # Completed depth first, no node can be part of itself.
        self.deep_construct = True
        return super().construct_document(node)

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
        return int(super().construct_yaml_int(node)) if re.search("[bx]", text) else integer(text)

    yaml_implicit_resolvers = {  # noqa: RUF012 (a name of PyYAML)
        first: [(tag, pattern) for tag, pattern in kinds if tag not in _NUMBERS]
        for first, kinds in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


for _tag, _pattern in _NUMBERS.items():
    _Loader.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern})$"), list("-+.0123456789"))
_Loader.add_constructor(_INTEGER, _Loader.construct_yaml_int)


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
    except ValueError as error:  # a date that does not exist
        raise ValueError(f"{name}: not YAML: {error}") from None


def _fields(content: Any, name: str, example: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        got = "nothing" if content is None else f"{content!r:.40}"
        raise ValueError(f"{name}: expected fields such as `{example}`, got {got}")
    others = [key for key in content if not isinstance(key, str)]
    if others:
        raise ValueError(f"{name}: expected names of fields such as `{example}`, got {others[0]!r:.40}")
    return content
