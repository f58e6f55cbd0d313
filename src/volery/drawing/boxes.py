"""What a diagram consists of, before it has places: boxes with ports, links between ports, a frame."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BoxPort:
    """A port of a box. Provided ones are on its left side with a lollipop, required ones on its right."""

    name: str
    interface: str
    provided: bool


@dataclass(frozen=True)
class Box:
    """A component, a vehicle or the whole system. ``kind`` is its colour, ``active`` its double sides."""

    key: str
    title: str
    stereotype: str
    note: str = ""
    kind: str = "passive"
    ports: tuple[BoxPort, ...] = ()
    active: bool = False

    @property
    def provided(self) -> list[BoxPort]:
        """The ports on its left side."""
        return [port for port in self.ports if port.provided]

    @property
    def required(self) -> list[BoxPort]:
        """The ports on its right side."""
        return [port for port in self.ports if not port.provided]


@dataclass(frozen=True)
class BoxLink:
    """A required port and the provided port that it is connected to; ports are named."""

    source: str
    source_port: str
    target: str
    target_port: str


@dataclass(frozen=True)
class Diagram:
    """Boxes and links. ``framed`` are inside the frame called ``frame``; ``before`` stand left of it."""

    title: str
    boxes: tuple[Box, ...]
    links: tuple[BoxLink, ...]
    frame: str = ""
    framed: frozenset[str] = frozenset()
    before: frozenset[str] = frozenset()
