"""The JSON Schema of a model's text: for editors, for messages, and to know which paths there can be."""

from __future__ import annotations

from functools import cache
from typing import Any

from volery.model.fields import SHORT
from volery.model.form import ModelForm
from volery.model.problems import Path

Schema = dict[str, Any]


@cache
def schema() -> Schema:
    """The schema of a whole model (draft 2020-12). An editor that is given it completes and checks keys."""
    made = ModelForm.model_json_schema(by_alias=True)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **_tidy(made),
        "title": "volery system model",
    }


def keys_at(path: Path) -> list[str] | None:
    """The known keys of the mapping at *path*; ``None`` where names are free or no mapping can stand."""
    known = [key for found in _variants_at(path) for key in found.get("properties", {})]
    return list(dict.fromkeys(known)) or None


def names_are_free(path: Path) -> bool:
    """True if the entries of the mapping at *path* are named by the model: components, processors, ports."""
    return any(_free(found) for found in _variants_at(path))


def short_key(path: Path) -> str | None:
    """The key that is meant where the mapping at *path* is written as a single value; ``None`` if it cannot
    be.
    """
    return next((str(found[SHORT]) for found in _options_at(path) if SHORT in found), None)


def _tidy(made: Any) -> Any:
    """Without the titles that repeat the keys."""
    if isinstance(made, dict):
        return {
            key: {name: _tidy(inner) for name, inner in value.items()}
            if key in ("properties", "$defs")
            else _tidy(value)
            for key, value in made.items()
            if key != "title"
        }
    return [_tidy(item) for item in made] if isinstance(made, list) else made


def _variants_at(path: Path) -> list[Schema]:
    return [found for found in _options_at(path) if "$ref" not in found and "anyOf" not in found]


def _options_at(path: Path) -> list[Schema]:
    """What may stand at *path*: every alternative, and the alternatives' own."""
    places = _resolved(schema())
    for step in path:
        places = [option for place in places for below in _below(place, step) for option in _resolved(below)]
    return places


def _below(place: Schema, step: str | int) -> list[Schema]:
    if step in place.get("properties", {}):
        return [place["properties"][step]]
    if _free(place):
        return _free(place)
    if "items" in place and str(step).isdigit():
        return [place["items"]]
    return []


def _free(place: Schema) -> list[Schema]:
    """What entries with names of the model's own are."""
    others = place.get("additionalProperties")
    return [*place.get("patternProperties", {}).values(), *([others] if isinstance(others, dict) else [])]


def _resolved(place: Schema) -> list[Schema]:
    if "$ref" in place:
        return [place, *_resolved(schema()["$defs"][place["$ref"].rpartition("/")[2]])]
    if "anyOf" in place:
        return [place, *(variant for option in place["anyOf"] for variant in _resolved(option))]
    return [place]
