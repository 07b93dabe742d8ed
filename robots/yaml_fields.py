"""YAML that a user has written: repeated keys are refused, errors are in words."""

from pathlib import Path
from typing import Any

import yaml


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


def _fields(content: Any, name: str, example: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        got = "nothing" if content is None else f"{content!r:.40}"
        raise ValueError(f"{name}: expected fields such as `{example}`, got {got}")
    other = next((key for key in content if not isinstance(key, str)), None)
    if other is not None:
        raise ValueError(f"{name}: expected names of fields such as `{example}`, got {other!r:.40}")
    return content
