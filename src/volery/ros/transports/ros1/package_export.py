"""Export of an interface package for ROS 1: definitions, and modules that rostopic and rosservice import.

For packages that no distribution has any more, such as roscopter.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.ros.messages import Ros1Type, ros1_service, ros1_type, service_types, types
from volery.ros.transports.ros1.rospy_copy import available

_NEXT = "=" * 80 + "\nMSG: "
_MANIFEST = """<?xml version="1.0"?>
<package format="2">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>Interfaces of {name}, written out.</description>
  <maintainer email="maintainer@example.com">volery</maintainer>
  <license>Apache-2.0</license>
</package>
"""


def write_package(package: str, folder: Path) -> Path:
    """Write an interface package and return its folder.

    With `folder` on ``PYTHONPATH`` and ``ROS_PACKAGE_PATH``, ROS finds the package as if it were installed.

    Args:
        package: Name of a package that volery defines.
        folder: Parent of the package's folder.

    Raises:
        UsageError: the package is unknown, genpy is not installed, or the folder cannot be written.
    """
    messages = [name for name in types() if name.startswith(f"{package}/")]
    services = [name for name in service_types() if name.startswith(f"{package}/")]
    if not messages and not services:
        known = sorted({name.partition("/")[0] for name in (*types(), *service_types())})
        raise UsageError(f"no package {package!r}{did_you_mean(package, known)}; there is {choices(known)}")
    if not available():
        raise UsageError(
            "ROS 1's genpy makes the modules, and this Python does not see it: see `volery doctor`"
        )
    made = folder / package
    try:
        _write(made, "package.xml", _MANIFEST.format(name=package))
        _write(made, "__init__.py", "")
        _write_messages(made, messages)
        _write_services(made, services)
    except OSError as error:
        raise UsageError(f"{made} cannot be written: {error.strerror or error}") from error
    return made


def _write(folder: Path, name: str, text: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")


def _write_messages(made: Path, names: list[str]) -> None:
    modules = []
    for name in names:
        kind = ros1_type(name)
        label = kind.name.partition("/")[2]
        _write(made / "msg", f"{label}.msg", _own(kind))
        _write(made / "msg", f"_{label}.py", "\n".join(_message_module(kind)) + "\n")
        modules.append(f"from ._{label} import *\n")
    if modules:
        _write(made / "msg", "__init__.py", "".join(modules))


def _write_services(made: Path, names: list[str]) -> None:
    modules = []
    for name in names:
        kind = ros1_service(name)
        label = kind.name.partition("/")[2]
        halves = f"{_own(kind.request)}---\n{_own(kind.response)}"
        _write(made / "srv", f"{label}.srv", halves)
        lines = _service_module(kind.name, halves, kind.request, kind.response)
        _write(made / "srv", f"_{label}.py", "\n".join(lines) + "\n")
        modules.append(f"from ._{label} import *\n")
    if modules:
        _write(made / "srv", "__init__.py", "".join(modules))


def _own(kind: Ros1Type) -> str:
    """Return the type's own definition, without those of its nested types."""
    return kind.text.partition(_NEXT)[0].rstrip("\n") + "\n"


def _inner(kind: Ros1Type) -> Iterator[tuple[str, str]]:
    """Yield names and definitions of the nested types."""
    for section in kind.text.split(_NEXT)[1:]:
        name, _, text = section.partition("\n")
        yield name.strip(), text


def _context(*kinds: Ros1Type) -> Any:
    """Return a genmsg context with all nested types, so that genmsg reads no files."""
    loader = import_module("genmsg.msg_loader")
    context = import_module("genmsg").MsgContext.create_default()
    for kind in kinds:
        for name, text in _inner(kind):
            if not context.is_registered(name):
                context.register(name, loader.load_msg_from_string(context, text, name))
    return context


def _message_module(kind: Ros1Type) -> Iterator[str]:
    context = _context(kind)
    spec = import_module("genmsg.msg_loader").load_msg_from_string(context, _own(kind), kind.name)
    yield from import_module("genpy.generator").msg_generator(context, spec, {})


def _service_module(name: str, text: str, *halves: Ros1Type) -> Iterator[str]:
    context = _context(*halves)
    spec = import_module("genmsg.msg_loader").load_srv_from_string(context, text, name)
    yield from import_module("genpy.generator").srv_generator(context, spec, {})
