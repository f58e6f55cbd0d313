"""A message on a link, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass
class Frame:
    """A message: its name and fields as the protocol defines them (``HEARTBEAT``, ``custom_mode`` ...).

    ``system`` and ``component`` are the ids of the sender. A frame and its fields are never changed after
    sending. The constructor is written out because mypyc does not compile that of a dataclass.
    """

    name: str
    fields: dict[str, Any]
    system: int
    component: int

    def __init__(self, name: str, fields: dict[str, Any], system: int, component: int) -> None:
        self.name = name
        self.fields = fields
        self.system = system
        self.component = component
