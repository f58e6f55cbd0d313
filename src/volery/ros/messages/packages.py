"""Interface packages as modules, for ``from std_msgs.msg import String``, and packages beside a user's file.

``from robot_msgs.msg import Wheels`` in a file finds ``robot_msgs/msg/Wheels.msg`` beside the file, in the
file's own package, or in a folder of ``ROS_PACKAGE_PATH`` or ``AMENT_PREFIX_PATH``, and its nested types
likewise.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from volery.base.errors import Location, ModelError, UsageError, choices, did_you_mean
from volery.ros.messages.client_classes import RCLPY, Library, generated_module, message_of, service_of
from volery.ros.messages.store import (
    ROS1_SPELLING,
    action_types,
    define_all,
    define_ros1_action,
    replace_known,
    service_types,
    types,
)
from volery.ros.messages.workspace import Workspace, entries

_OF_ROS1 = ("std_msgs/msg/Duration", "std_msgs/msg/Time")
"""Types that ROS 2 has not, of packages that it has."""


class _Definitions(ModuleType):
    """Module ``package.msg``, ``package.srv`` or ``package.action``, whose classes are created on demand."""

    def __init__(self, package: str, kind: str, names: list[str], library: Library) -> None:
        super().__init__(f"{package}.{kind}", f"The {kind} types of {package}.")
        self._package, self._kind, self._library = package, kind, library
        self._known = names
        ends = ("", "Request", "Response") if kind == "srv" else ("",)
        self.__all__ = [f"{name}{end}" for name in names for end in ends]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        wanted = ROS1_SPELLING.get(self._package, {}).get(name, name)
        for ending in ("Request", "Response"):
            if self._kind == "srv" and wanted.endswith(ending) and wanted not in self._known:
                pair = getattr(self, wanted.removesuffix(ending).removesuffix("_"))
                return getattr(pair, f"_{ending.lower()}_class")
        for part in ("SendGoal", "GetResult", "FeedbackMessage", "Goal", "Result", "Feedback"):
            if self._kind == "action" and wanted.endswith(f"_{part}") and wanted not in self._known:
                return getattr(getattr(self, wanted.removesuffix(f"_{part}")), part)
        if wanted not in self._known and self._kind == "msg" and define_ros1_action(self._package, wanted):
            self._known.append(wanted)
        if wanted not in self._known:
            if why := _undefined.get(f"{self._package}/{self._kind}/{wanted}"):
                raise AttributeError(f"{self.__name__}.{name} cannot be used: {why}")
            hint = did_you_mean(name, self._known)
            raise AttributeError(f"{self.__name__} has no {name!r}{hint}; it has {choices(self._known)}")
        full = f"{self._package}/{self._kind}/{wanted}"
        made = _MAKERS[self._kind](full, self._library)
        setattr(self, name, made)
        return made


def _action_class(full: str, library: Library) -> type:
    """Return the class of ``from package.action import Name``."""
    inner = full.replace("/action/", "/msg/")
    members = {
        "__module__": generated_module(full),
        "_type": full,
        **{part: message_of(f"{inner}_{part}", library) for part in ("Goal", "Result", "Feedback")},
    }
    parts = {
        "SendGoal": service_of(f"{full}_SendGoal", library),
        "GetResult": service_of(f"{full}_GetResult", library),
        "FeedbackMessage": message_of(f"{full}_FeedbackMessage", library),
    }
    protocol = {  # as rosidl names them
        "SendGoalService": parts["SendGoal"],
        "GetResultService": parts["GetResult"],
        "FeedbackMessage": parts["FeedbackMessage"],
        "CancelGoalService": service_of("action_msgs/srv/CancelGoal", library),
        "GoalStatusMessage": message_of("action_msgs/msg/GoalStatusArray", library),
    }
    return type(full.rpartition("/")[2], (), {**members, **parts, "Impl": type("Impl", (), protocol)})


_MAKERS: dict[str, Callable[[str, Library], type]] = {
    "msg": message_of,
    "srv": service_of,
    "action": _action_class,
}


def modules(only: str = "", library: Library = "") -> dict[str, ModuleType]:
    """Return the modules of all packages (``std_msgs``, ``std_msgs.msg``, ...), or of one, by import name.

    Args:
        only: Name of the package; empty for all.
        library: Client library whose classes they have; empty for the graph's.
    """
    found: dict[str, ModuleType] = {}
    for kind, names in (("msg", types()), ("srv", service_types()), ("action", action_types())):
        by_package: dict[str, list[str]] = {}
        for full in names:
            package = full.split("/")[0]
            if only in ("", package) and not (library == RCLPY and full in _OF_ROS1):
                by_package.setdefault(package, []).append(full.split("/")[-1])
        for package, listed in by_package.items():
            parent = found.setdefault(package, ModuleType(package))
            parent.__path__ = []
            inner = _Definitions(package, kind, listed, library)
            setattr(parent, kind, inner)
            found[f"{package}.{kind}"] = inner
    return found


KINDS = ("msg", "srv", "action")
_LEVELS = 3
"""Number of levels above a file in which its package may begin."""
_FIELD = re.compile(r"^\s*(\w+)/(?:msg/)?\w+(?:\[[^]]*\])?\s+\w", re.MULTILINE)
_NAME = re.compile(r"<name>\s*([\w-]+)\s*</name>")


_FIELD_TYPE = re.compile(r"^\s*(\w+)(?:/(?:msg/)?(\w+))?(?:<=\d+)?(?:\[[^]]*\])?\s+\w", re.MULTILINE)


def _definable(texts: dict[str, str]) -> dict[str, str]:
    """Return the types without those that lack a type of another package, or have a wstring.

    One such type, which no file may use, must not make its whole package unusable.
    """
    known = set(types())
    while True:
        there = known | texts.keys()
        lacking = {
            name: "wstring is not supported" if package == "wstring" else f"there is no {package}/{kind}"
            for name, text in texts.items()
            for package, kind in _field_types(name.partition("/")[0], text)
            if package == "wstring" or (kind and f"{package}/msg/{kind}" not in there)
        }
        if not lacking:
            return texts
        _undefined.update(lacking)
        texts = {name: text for name, text in texts.items() if name not in lacking}


def _field_types(own: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield package and name of each field's type; a basic type's own name and nothing."""
    for first, second in _FIELD_TYPE.findall(text):
        of_own = not second and first[0].isupper() and first != "Header"
        yield (own, first) if of_own else (first, second)


_undefined: dict[str, str] = {}
"""Types of files that could not be defined, and why."""


def define_imported(file: Path, workspace: Workspace | None = None) -> list[str]:
    """Define the interfaces that a Python file imports; see ``define_packages``."""
    return define_packages(file, _imported(file), workspace)


def define_packages(file: Path, packages: Iterable[str], workspace: Workspace | None = None) -> list[str]:
    """Define the interfaces of `packages`, used in `file`, as far as they are not known; return those found.

    They are searched beside the file and in `workspace`, by default what the environment names now. A package
    that is known, as volery has a part of it, gets the types that are found there in addition, and those that
    are defined otherwise there; see ``replace_known``.

    Raises ``ModelError`` at the interface's file if it is no definition. Packages that are not found are
    ignored.
    """
    types_known = {*types(), *service_types(), *action_types()}
    known = {name.partition("/")[0] for name in types_known}
    known -= _from_files.keys()  # another file may mean another package by the same name
    workspace = workspace or Workspace()
    texts: dict[str, str] = {}
    found: list[str] = []
    wanted = list(packages)
    while wanted:
        package = wanted.pop(0)
        folder = _folder_of(package, file, workspace)
        if folder is None or package in found:
            continue
        there = list(_texts(package, folder))
        if package in known:
            there = [one for one in there if one[0] not in types_known or replace_known(*one)]
            if not there:
                continue
        found.append(package)
        for name, text in there:
            texts[name] = text
            wanted += [other for other in _FIELD.findall(text) if other not in (*known, *found)]
    texts = _definable(texts)
    try:
        define_all({name: text for name, text in texts.items() if _from_files.get(name) != text})
    except UsageError as error:
        raise ModelError(str(error), where=Location(str(file), 1)) from error
    _from_files.update(texts)
    _from_files.update(dict.fromkeys((one for one in found if one not in known), ""))
    return found


_from_files: dict[str, str] = {}
"""Definitions read from files so far, by name, and the packages' own names."""


def _imported(file: Path) -> list[str]:
    """Return the packages whose interfaces the file imports, in order; none if it is not Python.

    What is wrong with such a file is reported when it is loaded.
    """
    found: dict[str, None] = {}
    try:
        tree = ast.parse(file.read_bytes(), filename=str(file))
    except (OSError, ValueError, SyntaxError, RecursionError):
        return []
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            package, _, kind = name.partition(".")
            if kind.partition(".")[0] in KINDS:
                found[package] = None
    return list(found)


def _texts(package: str, folder: Path) -> Iterator[tuple[str, str]]:
    for kind in KINDS:
        for path in sorted((folder / kind).rglob(f"*.{kind}")):  # ROS 1 packages sort them into folders
            yield f"{package}/{kind}/{path.stem}", path.read_text(encoding="utf-8")


def _folder_of(package: str, file: Path, workspace: Workspace) -> Path | None:
    """Return the folder of a package's interfaces, searched from `file` and in the workspace."""
    candidates = _candidates(package, file, workspace)
    return next((folder for folder in candidates if _is_package(folder, package)), None)


def _candidates(package: str, file: Path, workspace: Workspace) -> Iterator[Path]:
    for folder in file.resolve().parents[: _LEVELS + 1]:
        yield folder / package
        yield folder
    found = workspace.find(package, file)
    if found is not None:
        yield found.folder
    for entry in entries("ROS_PACKAGE_PATH"):  # folders without a manifest
        yield entry / package
        yield entry
    for entry in entries("AMENT_PREFIX_PATH"):
        yield entry / "share" / package


def _is_package(folder: Path, package: str) -> bool:
    if not any((folder / kind).is_dir() for kind in KINDS):
        return False
    manifest = folder / "package.xml"
    if not manifest.is_file():
        return folder.name == package
    named = _NAME.search(manifest.read_text(encoding="utf-8", errors="replace"))
    return named is not None and named.group(1) == package
