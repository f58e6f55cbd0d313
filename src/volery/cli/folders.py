"""Where runs are kept, and where examples are found."""

from __future__ import annotations

import re
from pathlib import Path

import volery
from volery.base.errors import UsageError

RUNS = Path("runs")


def next_folder(name: str) -> Path:
    """A run folder that is not there yet: ``runs/hospital-delivery-3``."""
    stem = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "run"
    taken = [path.name.removeprefix(f"{stem}-") for path in RUNS.glob(f"{stem}-*")]
    number = max((int(text) for text in taken if text.isdigit()), default=0) + 1
    return RUNS / f"{stem}-{number}"


def example(name: str) -> Path:
    """An example that comes with the package, or in a checkout stands beside it."""
    package = Path(volery.__file__).parent
    for folder in (package / "examples", package.parents[1] / "examples"):
        if (folder / name).exists():
            return folder / name
    raise UsageError(f"this installation has no example {name!r}; was it installed from a whole checkout?")
