"""The lines of a timeline: spans of tasks on cores, other spans, and marks.

Format: *Trace Event Format*, Google, 2016.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.time import Ns
from volery.trace.events import Slice

_WRITTEN_AT_ONCE = 1000  # lines


class Spans:
    """The lines of a timeline. ``last`` is the latest time of them, ns; it may be set.

    Args:
        write: Writes a part of the file.
        track_of: Returns ``pid`` and ``tid`` of a core of a processor as JSON.
        name_of: Returns the name of a task of a component as JSON.
    """

    def __init__(
        self,
        write: Callable[[bytes], Any],
        track_of: Callable[[str, int], str],
        name_of: Callable[[str, str], str],
    ) -> None:
        self.last: Ns = 0
        self._write, self._track_of, self._name_of = write, track_of, name_of
        self._lines: list[str] = []
        self._separator = "[\n"
        self._pairs = 0
        self._running: dict[tuple[Any, ...], tuple[Ns, Slice]] = {}
        self._tracks: dict[tuple[Any, ...], str] = {}
        self._names: dict[tuple[Any, ...], str] = {}

    def add(self, line: str) -> None:
        """Add a line as it is."""
        self._lines.append(line)
        if len(self._lines) >= _WRITTEN_AT_ONCE:
            self._write_out()

    def complete(self, name: str, start: Ns, end: Ns, where: str) -> None:
        """Add a span of a track whose spans do not overlap; *name* and *where* are JSON."""
        self.last = max(self.last, end)
        times = f'"ts":{_microseconds(start)},"dur":{_microseconds(end - start)}'
        self.add(f'{{"name":{name},"ph":"X",{times},{where}}}')

    def pair(self, name: str, start: Ns, end: Ns, category: str, where: str, details: str) -> None:
        """Add a span that may overlap with others: two lines with a number; all texts are JSON."""
        self.last = max(self.last, end)
        self._pairs += 1
        common = f'{category},"id":{self._pairs},{where}'
        self.add(f'{{"name":{name},"ph":"b","ts":{_microseconds(start)},{common},"args":{details}}}')
        self.add(f'{{"name":{name},"ph":"e","ts":{_microseconds(end)},{common}}}')

    def mark(self, name: str, scope: str, at: Ns, rest: str) -> None:
        """Add an instant of a thread (t) or of all (g, scope); *name* and *rest* of the line are JSON."""
        self.last = max(self.last, at)
        self.add(f'{{"name":{name},"ph":"i","s":"{scope}","ts":{_microseconds(at)},{rest}}}')

    def slice(self, event: Slice) -> None:
        """Add slices of one task that follow each other without a gap as one, when it ends."""
        core = event[2:4]
        running = self._running.get(core)
        if running is not None:
            if running[1].end == event.start and running[1][4:] == event[4:]:
                self._running[core] = (running[0], event)
                return
            self._ran(*running)
        self._running[core] = (event.start, event)

    def end_slices(self) -> None:
        """Add the slices that may still go on; none follows."""
        for running in self._running.values():
            self._ran(*running)
        self._running.clear()

    def close(self) -> None:
        """Write the lines that are left, and the end of the file."""
        self._write_out()
        self._write(b"[]\n" if self._separator == "[\n" else b"\n]\n")

    def _ran(self, start: Ns, event: Slice) -> None:
        where = self._tracks.get(event[2:4])
        if where is None:
            where = self._tracks[event[2:4]] = self._track_of(event.processor, event.core)
        name = self._names.get(event[4:])
        if name is None:
            name = self._names[event[4:]] = self._name_of(event.task, event.component)
        self.complete(name, start, event.end, where)

    def _write_out(self) -> None:
        if self._lines:
            text = self._separator + ",\n".join(self._lines)
            self._lines.clear()
            self._separator = ",\n"
            self._write(text.encode("utf-8", "replace"))


def _microseconds(ns: Ns) -> str:
    """Return a time in the unit of the format; three decimals keep the nanoseconds."""
    return f"{ns // 1000}.{ns % 1000:03d}"
