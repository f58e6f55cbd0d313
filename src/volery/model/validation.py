"""From a tree to its form, with pydantic's complaints put into the words of a model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from volery.base.errors import choices, did_you_mean
from volery.model.fields import Form
from volery.model.problems import Path, Problems
from volery.model.schema import keys_at
from volery.model.text import Node

F = TypeVar("F", bound=Form)

_EXPECTED = {
    "string_type": "text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "dict_type": "a mapping of keys",
    "model_type": "a mapping of keys",
    "model_attributes_type": "a mapping of keys",
    "list_type": "a list",
}


def validate(form: type[F], node: Node, problems: Problems, prefix: Path = ()) -> F | None:
    """The form of *node*, which stands at *prefix*; ``None``, with *problems* noted, if it is not one."""
    try:
        return form.model_validate(node.plain())
    except ValidationError as error:
        for path, what in _complaints(error, prefix):
            problems.add(path, what)
        return None


def _complaints(error: ValidationError, prefix: Path) -> Iterator[tuple[Path, str]]:
    for details in error.errors(include_url=False):
        path: Path = (*prefix, *details["loc"])
        if path and path[-1] == "[key]":
            name = details["input"]
            yield path[:-1], f"{name!r} is no name: letters, digits, _ and -, starting with a letter"
        else:
            yield path, _complaint(details, path)


def _complaint(details: ErrorDetails, path: Path) -> str:
    kind, written, context = details["type"], details["input"], details.get("ctx", {})
    if kind == "extra_forbidden":
        known = keys_at(path[:-1]) or []
        return f"unknown key{did_you_mean(str(path[-1]), known)}; valid here: {choices(known)}"
    if kind == "missing":
        return "this key is missing"
    if kind == "literal_error":
        return _not_one_of(written, str(context.get("expected", "")))
    if kind == "value_error":
        return str(context["error"])
    if kind in _EXPECTED:
        return f"{_EXPECTED[kind]} is expected, not {_shown(written)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}, not {_shown(written)}"


def _not_one_of(written: Any, expected: str) -> str:
    names = [name.strip("' ") for name in expected.replace(" or ", ", ").split(",")]
    return f"{_shown(written)} is not one of {choices(names)}{did_you_mean(str(written), names)}"


def _shown(written: Any) -> str:
    if written is None:
        return "nothing"
    if isinstance(written, dict):
        return "a mapping"
    if isinstance(written, list):
        return "a list"
    return repr(str(written)) if isinstance(written, str) else str(written)
