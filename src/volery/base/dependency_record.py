"""Record of the files that a compilation has read, with a digest of each: is the result still current?

A new header that the compiler would find before a recorded one is not noticed, as with ccache's direct mode.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path


def content_digest(path: Path) -> str:
    """Return the digest of a file's content; ``"gone"`` if the file cannot be read."""
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "gone"


def rule_dependencies(rule: str) -> list[str]:
    r"""Return the files of a compiler's rule for make: ``a.o: b.cpp c.h \``."""
    _, _, files = rule.replace("\\\n", " ").partition(": ")
    return [name.replace("\\ ", " ") for name in re.split(r"(?<!\\)\s+", files.strip()) if name]


def write_record(record: Path, files: Iterable[str]) -> None:
    """Write the record of files."""
    record.write_text(json.dumps({name: content_digest(Path(name)) for name in files}), encoding="utf-8")


def is_current(record: Path) -> bool:
    """Return whether there is a record and all its files are unchanged."""
    try:
        known = json.loads(record.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return all(content_digest(Path(name)) == content for name, content in known.items())
