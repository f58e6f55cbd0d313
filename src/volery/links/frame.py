"""A message on a link, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(slots=True)
class Frame:
    """A message: its name and fields as the protocol defines them (``HEARTBEAT``, ``custom_mode`` ...).

    ``system`` and ``component`` are the ids of the sender. A frame and its fields are never changed after
    sending.
    """

    name: str
    fields: dict[str, Any]
    system: int
    component: int
