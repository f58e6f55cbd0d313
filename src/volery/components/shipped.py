"""Where the examples are that come with the package: beside it once installed, else in the repository."""

from __future__ import annotations

from pathlib import Path

from volery.base.errors import UsageError, choices, did_you_mean

_PACKAGE = Path(__file__).parents[1]
_REPOSITORY = _PACKAGE.parents[1]


def examples() -> Path:
    """The folder of all examples."""
    for folder in (_PACKAGE / "examples", _REPOSITORY / "examples"):
        if folder.is_dir():
            return folder
    raise UsageError(f"the examples are missing from this installation of volery: no {_PACKAGE / 'examples'}")


def example(name: str) -> Path:
    """The folder or file of one: ``example("delivery")``, ``example("mission.py")``."""
    found = examples() / name
    if not found.exists():
        there = [one.name for one in examples().iterdir() if not one.name.startswith(("_", "."))]
        raise UsageError(f"no example {name!r}{did_you_mean(name, there)}; there is {choices(there)}")
    return found
