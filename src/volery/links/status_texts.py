"""MAVLink's status texts, which go in chunks of 50 characters when they are longer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

CHUNK = 50

Say = Callable[[int, str], None]


def chunks(severity: int, text: str, number: int) -> list[dict[str, Any]]:
    """The fields of the STATUSTEXTs that carry *text*; *number* tells those of one text from others'."""
    return [
        {"severity": severity, "text": text[start : start + CHUNK], "id": number, "chunk_seq": place}
        for place, start in enumerate(range(0, max(1, len(text)), CHUNK))
    ]


class Texts:
    """Puts chunks together. A text whose end is lost is told when the next one begins."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._number = 0
        self._severity = 0
        self._parts: dict[int, str] = {}

    def hear(self, fields: Mapping[str, Any]) -> None:
        """A STATUSTEXT: ``id`` 0 is a whole text; chunks of one text share another."""
        number: int = fields["id"]
        if self._parts and number != self._number:
            self._tell()
        if number == 0:
            self._say(fields["severity"], fields["text"])
            return
        self._number = number
        self._severity = fields["severity"]
        self._parts[fields["chunk_seq"]] = fields["text"]
        if len(fields["text"]) < CHUNK:
            self._tell()

    def _tell(self) -> None:
        parts = self._parts
        text = "".join(parts.get(number, " ... ") for number in range(max(parts) + 1))
        self._parts = {}
        self._say(self._severity, text)
