"""How compiled code is cached, and why changing a law never leaves an old one in force.

numba stamps a cached function with its own source file only: a function that calls one of another file would
be kept although the other changed. So nothing here that calls across files is cached, except the few entry
points that compile everything below them at once; those hold a digest of all sources as a constant, which
numba makes part of the cache's key.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def digest_of(files: Iterable[Path]) -> str:
    """A digest of the files' contents, in the order of their names."""
    digest = hashlib.sha256()
    for file in sorted(files, key=lambda file: file.name):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def world_sources() -> list[Path]:
    """The source files of this room."""
    return list(Path(__file__).parent.glob("*.py"))
