"""What makes frames of bytes and bytes of frames: one protocol."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Protocol

from volery.links.link import Frame

_KEPT_LINES = 20


@dataclass
class Heard:
    """What a parser has seen so far. ``lines`` are the last text lines that were no frame."""

    octets: int = 0
    frames: int = 0
    frames_v1: int = 0
    """Of the protocol's older version, which is understood but not spoken."""
    unknown: int = 0
    corrupt: int = 0
    text: int = 0
    garbage: int = 0
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_KEPT_LINES))


class FrameParser(Protocol):
    """A stream of bytes taken apart into frames."""

    heard: Heard

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by *data*, in order. Never raises, whatever arrives."""

    def reset(self) -> None:
        """Forget a half-received frame: the connection behind it is gone."""

    def problem(self) -> str:
        """What is wrong with what arrives, in words; empty if nothing is, or if nothing arrived."""


class Codec(Protocol):
    """A protocol's wire form. Frames that cannot be written raise ``UsageError`` naming message and field."""

    @property
    def name(self) -> str:
        """``MAVLink``, ``pprzlink``: for messages to people."""

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """The frame as bytes; *sequence* counts the frames of one sender, from 0, modulo 256."""

    def parser(self) -> FrameParser:
        """A new parser, for one stream of bytes."""

    def quantised(self, frame: Frame) -> Frame:
        """The frame as it arrives after a trip over the wire: widths of numbers, lengths of strings, all
        fields present.
        """
