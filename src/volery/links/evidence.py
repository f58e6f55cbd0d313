"""What arrives that is no frame: counted, its text lines kept, so that a problem can be named in words."""

from __future__ import annotations

from volery.links.codec import Heard

_PRINTABLE = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))
_LONGEST_LINE = 120


class Evidence:
    """Sorts the bytes between frames into text and garbage, and notes them in *heard*."""

    def __init__(self, heard: Heard) -> None:
        self._heard = heard
        self._line = bytearray()

    def note(self, octet: int) -> None:
        """A byte that belongs to no frame."""
        if octet not in _PRINTABLE:
            self._heard.garbage += 1
            return
        self._heard.text += 1
        ends = octet in b"\r\n"
        if self._line and (ends or len(self._line) >= _LONGEST_LINE):
            self._heard.lines.append(self._line.decode("ascii"))
            self._line.clear()
        if not ends:
            self._line.append(octet)

    def only_text(self) -> str:
        """``only text arrives: '...'`` if that is so; else empty."""
        if self._heard.text <= 4 * self._heard.garbage:
            return ""
        lines = [line for line in self._heard.lines if line.strip()]
        return f"only text arrives: {lines[0] if lines else self._line.decode('ascii')!r}"
