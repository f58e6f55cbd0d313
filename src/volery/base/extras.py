"""Optional dependencies: the packages of each extra of volery, and the error when they are missing.

``pip install volery`` is enough to fly a real vehicle over MAVLink. A package that needs more calls
``require_extra`` before it imports the library, so that the user gets the command that installs it.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

from volery.base.errors import UsageError

EXTRAS: Mapping[str, tuple[str, ...]] = {
    "simulation": ("numba",),
    "model": ("ruamel.yaml", "networkx"),
    "ros": ("rosbags", "lz4"),
    "report": ("jinja2",),
}
"""Modules that each extra installs, as in ``pyproject.toml``."""


class MissingExtraError(UsageError):
    """An optional dependency is not installed.

    Attributes:
        extra: The extra of volery that installs it.
    """

    def __init__(self, extra: str, purpose: str, missing: tuple[str, ...]) -> None:
        self.extra = extra
        verb = "is" if len(missing) == 1 else "are"
        super().__init__(f"{purpose}: {' and '.join(missing)} {verb} not installed; {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f'pip install "volery[{extra}]"'


def require_extra(extra: str, purpose: str) -> None:
    """Check that the packages of an extra are installed.

    Args:
        extra: One of ``EXTRAS``.
        purpose: What needs the packages, as the message begins: "simulated vehicles".

    Raises:
        MissingExtraError: A package is missing.
    """
    missing = tuple(name for name in EXTRAS[extra] if not _is_installed(name))
    if missing:
        raise MissingExtraError(extra, purpose, missing)


def missing_extra(error: ModuleNotFoundError) -> MissingExtraError | None:
    """Return the error for a failed import if an extra installs the module, else None."""
    module = error.name or ""
    for extra, names in EXTRAS.items():
        for name in names:
            if module == name or module.startswith(f"{name}.") or module == name.partition(".")[0]:
                return MissingExtraError(extra, "this command", (name,))
    return None


def _is_installed(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # the parent package of a dotted name
        return False
