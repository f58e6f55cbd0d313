"""The whole calibration: every snippet in turn, kept after each, so that a broken-off one goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.calibration.processor.timing import Taken, build, names, take

Show = Callable[[str, int, int], None]
"""Told after each snippet: its name, how many are done, of how many."""


def measure(notes: Path, show: Show) -> dict[str, Taken]:
    """Time every snippet that *notes* does not have yet, and write it there."""
    taken = read_notes(notes)
    wanted = names()
    with TemporaryDirectory(prefix="volery-processor-") as folder:
        program = build(Path(folder))
        for number, name in enumerate(wanted, 1):
            if name not in taken:
                taken[name] = take(program, name)
                notes.write_text(
                    json.dumps({one: asdict(told) for one, told in taken.items()}), encoding="utf-8"
                )
            show(name, number, len(wanted))
    return {name: taken[name] for name in wanted}


def read_notes(notes: Path) -> dict[str, Taken]:
    """What an earlier run took; nothing if there was none or its notes cannot be read."""
    try:
        told = json.loads(notes.read_text(encoding="utf-8"))
        return {name: Taken(**one) for name, one in told.items()}
    except (OSError, ValueError, TypeError):
        return {}


def loose(taken: dict[str, Taken]) -> list[str]:
    """What is not known tightly."""
    return [name for name, one in taken.items() if not one.tight]
