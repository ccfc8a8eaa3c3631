"""Reads YAML files that people write, strictly, as a word that is ignored may move robots."""

import re
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from .errors import InputError

Model = TypeVar("Model", bound=BaseModel)
MOST_BYTES = 1_000_000
PLAIN = re.compile("[-+]?(0|[1-9][0-9]*)")
"""Whole numbers that YAML 1.1 and people read alike."""


def content_of(path: Path, begin: str) -> dict[str, Any]:
    """Return the mapping that a file holds.

    Args:
        begin: a line that such a file may begin with, for the error.

    Raises:
        InputError: the file is too large, cannot be read, is not YAML, says something twice, has
            a number that may be meant as a name, or holds no mapping.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is larger than {MOST_BYTES:,} bytes; say less in one file.")
        content: Any = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except _UnclearError as error:
        raise InputError(f"{path}: {error}.") from None
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        where = " ".join(str(error).split())
        raise InputError(f"{path} is not YAML: {where}.") from None
    if not isinstance(content, dict):
        raise InputError(f"{path} holds no keys and values; begin it with a line `{begin}`.")
    return {str(key): value for key, value in cast("dict[Any, Any]", content).items()}


def validated(path: Path, what: str, model: type[Model], given: Mapping[str, Any]) -> Model:
    """Return a file's content as a model.

    Args:
        what: what the file describes, with its article.

    Raises:
        InputError: the file does not describe that; the text names every mistake.
    """
    try:
        return model.model_validate(given)
    except ValidationError as error:
        wrong = "; ".join(_mistake(found) for found in error.errors())
        raise InputError(f"{path} does not describe {what}: {wrong}.") from None


def _mistake(found: ErrorDetails) -> str:
    where = ".".join(map(str, found["loc"]))
    if found["type"] == "extra_forbidden":
        return f"{where}: no such key"
    if found["type"] == "value_error":  # a sentence of ours, which quotes what was given if it may
        return f"{where}: {found.get('ctx', {})['error']}".removeprefix(": ")
    told = f"{where}: {found['msg'].lower()}, got {found['input']!r}"
    unquoted = found["type"] == "string_type" and isinstance(found["input"], int | float | date)
    return f"{told}: put it in quotes" if unquoted else told


class _UnclearError(yaml.YAMLError):
    """A file is YAML, and what it means is not what a person reads in it."""


class _Loader(yaml.SafeLoader):
    """A loader that refuses a key given twice, as one of the two would be ignored, and whole
    numbers that YAML 1.1 reads by another base: 0017 would be robot 15.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise _UnclearError(f"{key!r} is said more than once")
        return super().construct_mapping(node, deep)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        written, number = node.value, super().construct_yaml_int(node)
        if not PLAIN.fullmatch(written):
            raise _UnclearError(
                f"line {node.start_mark.line + 1} has {written}, which YAML reads as the number "
                f"{number}; put it in quotes if it is a name, else write {number}"
            )
        return number


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
