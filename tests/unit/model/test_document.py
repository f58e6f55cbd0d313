"""The JSON Schema is published: a change of it is meant. Set VOLERY_UPDATE_GOLDEN=1 to take the new one."""

import json
import os
from pathlib import Path

from volery.model.document import keys_at, names_are_free, schema, short_key

GOLDEN = Path(__file__).parents[2] / "golden" / "model-schema.json"


def test_the_schema_is_the_published_one():
    text = json.dumps(schema(), indent=1) + "\n"
    if os.environ.get("VOLERY_UPDATE_GOLDEN"):
        GOLDEN.write_text(text)
    assert text == GOLDEN.read_text()


def test_every_reference_in_it_leads_somewhere():
    known = schema()["$defs"]

    def references(place):
        if isinstance(place, dict):
            if "$ref" in place:
                yield place["$ref"].removeprefix("#/$defs/")
            for below in place.values():
                yield from references(below)
        elif isinstance(place, list):
            for below in place:
                yield from references(below)

    assert set(references(schema())) <= set(known)


def test_it_knows_paths():
    assert "carried_by" in keys_at(("platform", "processors", "any"))
    assert keys_at(("platform", "processors")) is None
    assert names_are_free(("platform", "processors"))
    assert not names_are_free(("platform",))
    assert keys_at(("nowhere", "at", "all")) is None
    assert short_key(("environment", "vehicles", "d", "battery")) == "capacity"
    assert short_key(("environment", "workload")) is None


def test_every_property_has_a_description():
    def undescribed(place, path):
        if isinstance(place, dict):
            for name, below in place.get("properties", {}).items():
                if not below.get("description"):
                    yield f"{path}.{name}"
            for key, below in place.items():
                yield from undescribed(below, f"{path}.{key}")

    assert list(undescribed(schema(), "")) == []


def test_defaults_are_written_as_a_model_writes_them():
    run = schema()["$defs"]["RunLimits"]["properties"]["duration"]
    assert (run["default"], run["x-unit"]) == ("900 s", "s")
    assert schema()["$defs"]["ProcessorSpec"]["properties"]["scheduler"]["enum"][0] == "fixed-priority"


def test_a_figure_may_take_its_reference_from_its_component():
    assert schema()["$defs"]["StatedFigure"]["required"] == ["time"]
