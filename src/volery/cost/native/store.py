"""Costs that were taken from a trace, kept in the user's cache by what was compiled for what."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from volery.cost.native.costs import Costs


def folder() -> Path:
    """Where costs are kept: ``VOLERY_CACHE``, or ``volery`` in the user's cache."""
    named = os.environ.get("VOLERY_CACHE")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "volery"


def kept_costs(key: str) -> Costs | None:
    """The costs kept for the code and core of that ``Program.key``, if there are any."""
    try:
        with np.load(_file(key)) as kept:
            return Costs(kept["cycles"], kept["instructions"], kept["memory"], kept["seen"])
    except (OSError, KeyError, ValueError):
        return None


def keep_costs(key: str, costs: Costs) -> None:
    """Keep costs; without a place to write, nothing is kept."""
    file = _file(key)
    new = file.with_suffix(f".{os.getpid()}.npz")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(new, **asdict(costs))
        new.replace(file)
    except OSError:
        return


def _file(key: str) -> Path:
    return folder() / "native" / f"{key}.npz"
