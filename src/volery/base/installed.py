"""What is installed besides volery: plug-ins of other packages, and the optional dependencies of each extra.

A lower package reaches a higher one by name, through entry points: third parties register with an entry point
of their own package; a test or a script calls ``add``.

``pip install volery`` is enough to fly a real vehicle over MAVLink. A package that needs more calls
``require_extra`` before it imports the library, so that the user gets the command that installs it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Generic, TypeVar

from volery.base.errors import UsageError, choices, did_you_mean

T = TypeVar("T")


class Registry(Generic[T]):
    """Plug-ins of one kind by name: ``drivers.load("ardupilot")``."""

    def __init__(self, group: str, noun: str) -> None:
        self.group, self.noun = group, noun
        self._added: dict[str, T] = {}

    def add(self, name: str, thing: T) -> None:
        """Register *thing* for this process."""
        self._added[name] = thing

    @cached_property
    def _installed(self) -> dict[str, dict[str, EntryPoint]]:
        """{name: {value: entry point}}, with several values if packages disagree; read once a process."""
        found: dict[str, dict[str, EntryPoint]] = {}
        for point in entry_points(group=self.group):
            found.setdefault(point.name, {})[point.value] = point
        return found

    def names(self) -> list[str]:
        """Return all names, sorted, without importing anything."""
        return sorted(self._added.keys() | self._installed.keys())

    def load(self, name: str) -> T:
        """Import and return the plug-in *name*.

        Raises:
            UsageError: The name is unknown (the message lists the valid names), two packages register it, or
                the import fails.
        """
        if name in self._added:
            return self._added[name]
        installed = self._installed
        if name not in installed:
            hint = did_you_mean(name, self.names())
            raise UsageError(f"no {self.noun} named {name!r}{hint}; there is {choices(self.names())}")
        if len(installed[name]) > 1:
            raise UsageError(
                f"two packages provide the {self.noun} {name!r}: {' and '.join(sorted(installed[name]))}"
            )
        (point,) = installed[name].values()
        try:
            loaded: T = point.load()
        except (ImportError, AttributeError) as error:
            raise UsageError(f"the {self.noun} {name!r} cannot be loaded: {error}") from error
        return loaded


EXTRAS: Mapping[str, tuple[str, ...]] = {
    "simulation": ("numba",),
    "model": ("ruamel.yaml", "networkx"),
    "ros": ("rosbags", "lz4"),
    "report": ("jinja2",),
    "control": ("matplotlib", "pyulog"),
    "explore": ("scipy", "optuna", "SALib", "pandas", "pyarrow", "matplotlib"),
    "autonomy": ("scipy",),
    "vision": ("cv2",),
    "fmi": ("fmpy",),
    "dask": ("distributed",),
    "ray": ("ray",),
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
