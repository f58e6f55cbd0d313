"""Collecting what is wrong with a model, so that all of it is told at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from volery.base.errors import Location, ModelError, choices, did_you_mean

Path = tuple[str | int, ...]
"""A path in the model: keys and list positions from the top."""

Locate = Callable[[Path], Location | None]
"""Where something of a path stands; its nearest ancestor if it stands nowhere itself."""


def written(path: Path) -> str:
    """The path as messages and ``--set`` write it: ``platform.processors.onboard``."""
    return ".".join(str(step) for step in path)


class CollectedModelError(ModelError):
    """Several things are wrong with a model. ``errors`` has them one by one, in the order of the file."""

    def __init__(self, errors: Iterable[ModelError]) -> None:
        self.errors = tuple(errors)
        listed = "\n".join(str(error) for error in self.errors)
        super().__init__(f"{len(self.errors)} things are wrong with this model:\n{listed}")

    def __reduce__(self) -> tuple[type[CollectedModelError], tuple[tuple[ModelError, ...]]]:
        """So that it can be sent from process to process."""
        return type(self), (self.errors,)


class Problems:
    """What was found so far."""

    def __init__(self, locate: Locate) -> None:
        self._locate = locate
        self._found: list[ModelError] = []
        self._warnings: dict[str, None] = {}  # an ordered set

    def __bool__(self) -> bool:
        return bool(self._found)

    def add(self, path: Path, what: str, where: Location | None = None) -> None:
        """Note that *what* is wrong at *path* (or *where*, if known better); once if it comes twice."""
        error = ModelError(what, written(path), where or self._locate(path))
        if str(error) not in {str(known) for known in self._found}:
            self._found.append(error)

    def unknown(self, path: Path, name: object, noun: str, valid: Iterable[str]) -> None:
        """Note a *name* that nothing goes by; *valid* are the names there are."""
        self.add(path, no_such(name, noun, valid))

    def warn(self, path: Path, what: str) -> None:
        """Note that *what* is doubtful at *path*; the model stands nevertheless."""
        self._warnings[f"{written(path)}: {what}"] = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was found to be doubtful, once each."""
        return tuple(self._warnings)

    def where(self, path: Path) -> Location | None:
        """Where *path* stands."""
        return self._locate(path)

    def raise_if_any(self) -> None:
        """Raise what was found: a ``ModelError``, or one ``CollectedModelError`` for several."""
        if len(self._found) == 1:
            raise self._found[0]
        if self._found:
            raise CollectedModelError(sorted(self._found, key=_order))


def no_such(name: object, noun: str, valid: Iterable[str]) -> str:
    """``no processor named 'x' (did you mean 'y'?); there is y or z``."""
    names = list(valid)
    return f"no {noun} named {name!r}{did_you_mean(str(name), names)}; there is {choices(names)}"


def _order(error: ModelError) -> tuple[str, int]:
    return (error.where.file, error.where.line) if error.where else ("", 0)
