"""Names of other tools as names of a model."""

from __future__ import annotations

import re

_NO_NAME = re.compile(r"[^A-Za-z0-9_-]+")


def identifier(text: str) -> str:
    """Return *text* with everything replaced that a name in a model cannot have; empty if nothing is left."""
    made = _NO_NAME.sub("_", text.strip()).strip("_-")
    return f"_{made}" if made[:1].isdigit() else made
