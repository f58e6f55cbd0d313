"""Packages of ROS workspaces, and where their Python code is.

A file sees its own package, the packages beside it, those of the workspace that it lies in, and what the
environment names as a sourced workspace does: ``ROS_PACKAGE_PATH`` is searched as by rospkg, recursively down
to a manifest, ``AMENT_PREFIX_PATH`` as by ament, by the manifests in ``share``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

MANIFEST = "package.xml"
IGNORED = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")
"""Files that exclude a folder and all below it."""
LEVELS = 4
"""Number of folders above a file in which its package may begin."""
_NAME = re.compile(r"<name>\s*([\w-]+)\s*</name>")


class Package(NamedTuple):
    """A package: its name and the folder of its manifest; where it is installed, *prefix* has the rest."""

    name: str
    folder: Path
    prefix: Path | None = None

    def python_roots(self) -> list[Path]:
        """Return the folders from which its Python modules are imported.

        Of sources these are the package's folder (ament_python, ament_cmake_python) and its ``src`` (catkin).
        """
        if self.prefix is None:
            return [self.folder, self.folder / "src"]
        below = (
            "lib/python3*/site-packages",
            "lib/python3/dist-packages",
            "local/lib/python3*/dist-packages",
        )
        return [found for pattern in below for found in sorted(self.prefix.glob(pattern))]

    @property
    def include(self) -> Path:
        """Folder in which its C++ headers are searched; it need not exist."""
        return (self.prefix or self.folder) / "include"


def entries(variable: str) -> list[Path]:
    """Return the folders that an environment variable lists."""
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]


def module_file(folder: Path, name: str) -> Path | None:
    """Return the file of the module or regular package *name* (without a dot) in *folder*, or None."""
    for path in (folder / name / "__init__.py", folder / f"{name}.py"):
        if path.is_file():
            return path
    return None


class Workspace:
    """The packages that the files of one run can use; folders are searched once.

    Args:
        below: Folders whose packages are found, too, before those that the environment names.
    """

    def __init__(self, *below: Path) -> None:
        self._below = below
        self._beside: dict[Path, dict[str, Package]] = {}

    def package_of(self, file: Path) -> Package | None:
        """Return the package that *file* belongs to, or None."""
        for folder in file.resolve().parents[: LEVELS + 1]:
            if (folder / MANIFEST).is_file():
                return Package(_name_in(folder), folder)
        return None

    def find(self, name: str, file: Path) -> Package | None:
        """Return the package *name* as *file* sees it, or None."""
        for known in (self._own(file), self._sourced):
            if name in known:
                return known[name]
        return None

    def installed(self, name: str) -> Package | None:
        """Return the package *name* as a sourced workspace has installed it, or None."""
        found = self._sourced.get(name)
        return None if found is None or found.prefix is None else found

    def names(self, file: Path) -> set[str]:
        """Return the names of all packages that *file* sees."""
        return {*self._own(file), *self._sourced}

    def python_folder(self, module: str, file: Path) -> Path | None:
        """Return the folder from which *file* imports the top-level *module*, or None if no package has it.

        The package of that name comes first; other packages may contain the module, too.
        """
        own, named = self.package_of(file), self.find(module, file)
        for package in (own, named, *self._own(file).values(), *self._sourced.values()):
            if package is None or (package.prefix is not None and package is not named):
                continue  # where something is installed, all packages share one folder
            for root in package.python_roots():
                if module_file(root, module) is not None:
                    return root
        return None

    def package_with(self, header: str, file: Path) -> Package | None:
        """Return the package whose C++ header ``package/name.h`` *file* includes, or None."""
        named = self.find(header.partition("/")[0], file)
        for package in (named, *self._own(file).values(), *self._sourced.values()):
            if package is not None and (package.include / header).is_file():
                return package
        return None

    def _own(self, file: Path) -> dict[str, Package]:
        """Return the file's package, those beside it, and all of the workspace around it."""
        package = self.package_of(file)
        if package is None:
            return {}
        if package.folder not in self._beside:
            found = {package.name: package}
            siblings = (
                subfolder
                for subfolder in _subfolders(package.folder.parent)
                if (subfolder / MANIFEST).is_file()
            )
            sources = [parent for parent in package.folder.parents[:LEVELS] if parent.name == "src"]
            for one in _packages((*siblings, *sources[-1:])):
                found.setdefault(one.name, one)
            self._beside[package.folder] = found
        return self._beside[package.folder]

    @cached_property
    def _sourced(self) -> dict[str, Package]:
        found: dict[str, Package] = {}
        sources = [*self._below, *entries("ROS_PACKAGE_PATH")]
        for one in (*_packages(sources), *_installed(entries("AMENT_PREFIX_PATH"))):
            found.setdefault(one.name, one)
        return found


def _packages(folders: Iterable[Path]) -> Iterator[Package]:
    seen: set[Path] = set()
    for folder in folders:
        for one in _package_folders(folder, seen):
            installed = one.parent.name == "share" and (one.parent.parent / "lib").is_dir()
            yield Package(_name_in(one), one, one.parent.parent if installed else None)


def _package_folders(folder: Path, seen: set[Path]) -> Iterator[Path]:
    """Yield the folders of packages in *folder* and below; a package has no other packages in it."""
    real = folder.resolve()
    if real in seen or any((folder / name).exists() for name in IGNORED):
        return
    seen.add(real)
    if (folder / MANIFEST).is_file():
        yield folder
        return
    for below in _subfolders(folder):
        yield from _package_folders(below, seen)


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as found:
            names = sorted(one.name for one in found if not one.name.startswith(".") and one.is_dir())
    except OSError:
        return []
    return [folder / name for name in names]


def _installed(prefixes: Iterable[Path]) -> Iterator[Package]:
    for prefix in prefixes:
        for folder in _subfolders(prefix / "share"):
            if (folder / MANIFEST).is_file():
                yield Package(folder.name, folder, prefix)


def _name_in(folder: Path) -> str:
    """Return the name in the manifest of a package, or the folder's name where it states none."""
    try:
        text = (folder / MANIFEST).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return folder.name
    named = _NAME.search(text)
    return named.group(1) if named else folder.name
