"""The page about the run folder names everything that is in one."""

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from volery.requirements import record
from volery.trace.attachments import (
    MODEL_ATTACHMENT,
    SCENERY_SCHEMA,
    SETUP_ATTACHMENT,
    SETUP_SCHEMA,
    WORLD_ATTACHMENT,
)
from volery.trace.encoding import OWN_EVENTS
from volery.trace.mcap_writer import TRACE_SCHEMA

PAGE = Path(__file__).parents[3] / "docs" / "run-folder.md"


@pytest.fixture(scope="module")
def quoted() -> set[str]:
    """All words in code quotes."""
    return {
        word
        for code in re.findall(r"`([^`\n]+)`", PAGE.read_text())
        for word in re.findall(r"[\w./-]+", code)
    }


def test_every_field_of_run_json(quoted: set[str]) -> None:
    parts = [part for part in vars(record).values() if isinstance(part, type) and issubclass(part, BaseModel)]
    fields = {field.alias or name for part in parts for name, field in part.model_fields.items()}
    assert len(fields) > 60
    assert fields - quoted == set()


def test_every_event_and_its_fields(quoted: set[str]) -> None:
    names = {kind.__name__ for kind in OWN_EVENTS} | {field for kind in OWN_EVENTS for field in kind._fields}
    assert names - quoted == set()


def test_every_schema_and_attachment(quoted: set[str]) -> None:
    named = {TRACE_SCHEMA, SCENERY_SCHEMA, SETUP_SCHEMA, record.RUN_SCHEMA}
    named |= {MODEL_ATTACHMENT, SETUP_ATTACHMENT, WORLD_ATTACHMENT}
    assert named - quoted == set()
