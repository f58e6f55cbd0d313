"""A description that is attached to a trace, as the JSON of a frozen dataclass that names its schema."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from volery.base.errors import UsageError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

D = TypeVar("D")


def to_json(description: DataclassInstance) -> bytes:
    """The description as UTF-8 JSON, the same bytes for the same description."""
    return json.dumps(asdict(description), ensure_ascii=False, separators=(",", ":")).encode()


def from_json(data: bytes, adapter: TypeAdapter[D], schema: str, what: str) -> D:
    """What ``to_json`` wrote. Raises ``UsageError``, which calls it *what*, if it is not of that schema."""
    try:
        raw: Any = json.loads(data)
        version = raw.get("schema") if isinstance(raw, dict) else None
        if version != schema:
            raise UsageError(f"the trace's {what} has schema {version!r}; this version reads {schema!r}")
        return adapter.validate_python(raw)
    except (ValueError, ValidationError) as error:
        raise UsageError(f"the trace's {what} cannot be read: {error}") from error
