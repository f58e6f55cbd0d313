"""The user's cache of native estimates: costs, assembly, objects and executables by digest.

A file's name has the digest of all it was made from, the compiler's version included, so it is never out of
date. Only the intermediate code of sources needs a record of the headers that it was made from. Where the
cache cannot be written, everything is made anew.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

MOST_KEPT = 2000
"""Files that are kept; the ones that were written first are removed."""

Make = Callable[[Path], object]
"""Writes a file."""


def cache_folder() -> Path:
    """Return the folder of the cache: ``$VOLERY_CACHE``, or ``volery`` in the user's cache."""
    named = os.environ.get("VOLERY_CACHE")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "volery"


def cached_path(name: str) -> Path:
    """Return the path of a file of the cache, which need not exist."""
    return cache_folder() / "native" / name


def digest(*parts: str | bytes) -> str:
    """Return the digest of texts and contents of files."""
    found = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        found.update(len(content).to_bytes(8, "little") + content)
    return found.hexdigest()[:24]


def keep_file(new: Path, name: str) -> Path:
    """Move a file into the cache and return its path; return ``new`` where the cache cannot be written."""
    place = cached_path(name)
    copy = place.with_name(f".{os.getpid()}.{name}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(new, copy)
        copy.replace(place)
        _remove_oldest(place.parent)
    except OSError:
        return new
    new.unlink()
    return place


def cached_file(name: str, folder: Path, make: Make, *, runs: bool = False) -> Path:
    """Return a file of the cache; make it first if the cache has none.

    Args:
        name: Name with the digest of all that the file depends on.
        folder: Folder in which the file is made.
        make: Writes the file.
        runs: The file is a program. It is made anew where the cache's file system does not run programs.
    """
    place = cached_path(name)
    if os.access(place, os.X_OK if runs else os.R_OK):
        return place
    new = folder / name
    make(new)
    place = keep_file(new, name)
    return place if not runs or os.access(place, os.X_OK) else new


def _remove_oldest(folder: Path) -> None:
    """Remove the oldest files until a tenth of the cache is free again."""
    with os.scandir(folder) as entries:
        found = [(entry.stat().st_mtime_ns, entry.path) for entry in entries if entry.is_file()]
    if len(found) > MOST_KEPT:
        for _, path in sorted(found)[: len(found) - MOST_KEPT * 9 // 10]:
            Path(path).unlink()
