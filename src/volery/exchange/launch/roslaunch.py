"""Launch files of ROS 1, as roslaunch reads them (wiki.ros.org/roslaunch/XML)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from volery.base.errors import Location
from volery.exchange.launch.expressions import evaluated
from volery.exchange.launch.launch_reading import (
    LaunchedNode,
    LaunchReading,
    UnresolvedError,
    environment_variable,
    file_text,
    flat,
    joined,
    truth,
    yaml_value,
)
from volery.exchange.xml_text import Element, xml_root

_SUBSTITUTION = re.compile(r"\$\(\s*([^()]*)\)")
_WITHOUT_EFFECT = {
    "output": "`output`: a run shows the warnings and errors of all nodes",
    "cwd": "`cwd`: nodes run in the folder of the run",
    "clear_params": "`clear_params`: a run begins without parameters",
}
_NOT_MAPPED = {
    "launch-prefix": "`launch-prefix` is left out",
    "machine": "`machine` is left out: an allocation of the model states where a node runs",
}


@dataclass(frozen=True)
class _Scope:
    """What holds at one place of a file: its namespace, arguments, remappings and private parameters."""

    file: Path
    namespace: str = "/"
    arguments: dict[str, str] = field(default_factory=dict)
    remaps: dict[str, str] = field(default_factory=dict)
    private: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)
    loaded: tuple[str, ...] = ()

    def below(self, namespace: str) -> _Scope:
        """Return the scope of a group: what is stated in it does not hold outside."""
        return replace(
            self,
            namespace=joined(self.namespace, namespace) if namespace else self.namespace,
            remaps=dict(self.remaps),
            private=dict(self.private),
            environment=dict(self.environment),
        )


class Ros1Reader:
    """Reads launch files of ROS 1 into *reading*."""

    def __init__(self, reading: LaunchReading) -> None:
        self._reading = reading
        self._anonymous: dict[str, str] = {}

    def read(self, root: Element, file: Path) -> None:
        """Read the first file, whose root element is *root*."""
        self._reading.enter(file, Location(str(file), 1), self._reading.given)
        self._elements(root, _Scope(file, given=self._reading.given))
        self._reading.leave()
        unknown = self._reading.given.keys() - self._reading.declared.keys()
        for name in sorted(unknown):
            self._reading.note(f"the file declares no argument {name!r}", Location(str(file), 1))

    def _elements(self, parent: Element, scope: _Scope) -> None:
        for element in parent:
            if not isinstance(element.tag, str):
                continue
            with self._noted(element, scope, f"<{element.tag}> is left out"):
                if self._is_wanted(element, scope):
                    self._element(element, scope)

    def _element(self, element: Element, scope: _Scope) -> None:
        handlers: dict[str, Callable[[Element, _Scope], None]] = {
            "arg": self._arg,
            "env": self._env,
            "group": self._group,
            "include": self._include,
            "node": self._node,
            "param": lambda one, there: self._param(one, there, None),
            "remap": self._remap,
            "rosparam": lambda one, there: self._rosparam(one, there, None),
        }
        handler = handlers.get(element.tag)
        if handler is not None:
            handler(element, scope)
        elif element.tag == "test":
            self._reading.note("<test> is left out: a test is no part of the system", _where(element, scope))
        else:
            self._reading.note(f"<{element.tag}> is left out", _where(element, scope))

    @contextmanager
    def _noted(self, element: Element, scope: _Scope, what: str) -> Iterator[None]:
        """Make a note of what is not known within the block."""
        try:
            yield
        except UnresolvedError as error:
            self._reading.note(f"{what}: {error}", _where(element, scope))

    # -- texts

    def _is_wanted(self, element: Element, scope: _Scope) -> bool:
        wanted = True
        if "if" in element.attrib:
            wanted = truth(self._text(element.get("if"), scope))
        if "unless" in element.attrib:
            wanted = wanted and not truth(self._text(element.get("unless"), scope))
        return wanted

    def _attribute(self, element: Element, name: str, scope: _Scope, default: str | None = None) -> str:
        value = element.get(name, default)
        if value is None:
            raise UnresolvedError(f"its attribute {name!r} is missing")
        return self._text(value, scope)

    def _text(self, text: str, scope: _Scope) -> str:
        """Return a text with its substitutions resolved."""
        stripped = text.strip()
        if stripped.startswith("$(eval ") and stripped.endswith(")"):
            return str(self._evaluated(stripped[len("$(eval ") : -1], scope))
        previous = None
        while previous != text and len(text) < 1 << 16:  # $(find x) may be within $(optenv A $(find x))
            previous = text
            text = _SUBSTITUTION.sub(lambda found: self._substitution(found.group(1), scope), text)
        return text

    def _substitution(self, command: str, scope: _Scope) -> str:
        name, _, rest = command.strip().partition(" ")
        rest = rest.strip()
        if name == "arg":
            return self._argument(rest, scope)
        if name == "find":
            return str(self._reading.folder_of(rest, scope.file))
        if name == "env":
            return scope.environment.get(rest) or environment_variable(rest)
        if name == "optenv":
            variable, _, default = rest.partition(" ")
            return scope.environment.get(variable) or environment_variable(variable, default.strip())
        if name == "dirname":
            return str(scope.file.parent)
        if name == "anon":  # numbered in place of random, so that a file gives one model
            return self._anonymous.setdefault(rest, f"{rest}_{len(self._anonymous) + 1}")
        raise UnresolvedError(f"$({command}) is no substitution of roslaunch")

    @staticmethod
    def _argument(name: str, scope: _Scope) -> str:
        if name not in scope.arguments:
            raise UnresolvedError(f"the argument {name!r} has no value: state {name}:=VALUE")
        return scope.arguments[name]

    def _evaluated(self, text: str, scope: _Scope) -> Any:
        names: dict[str, Any] = {name: _typed(value) for name, value in scope.arguments.items()}
        names |= {
            "arg": lambda name: _typed(self._argument(name, scope)),
            "find": lambda name: self._substitution(f"find {name}", scope),
            "env": lambda name: self._substitution(f"env {name}", scope),
            "optenv": lambda name, default="": self._substitution(f"optenv {name} {default}", scope),
            "dirname": lambda: str(scope.file.parent),
            "anon": lambda name: self._substitution(f"anon {name}", scope),
        }
        return evaluated(text, names)

    # -- elements

    def _arg(self, element: Element, scope: _Scope) -> None:
        name = self._attribute(element, "name", scope)
        outermost = len(self._reading.open_files) == 1
        if "value" in element.attrib:
            scope.arguments[name] = self._attribute(element, "value", scope)
            return
        default = element.get("default")
        if outermost:
            self._reading.declared[name] = None
        if name in scope.given:
            scope.arguments[name] = scope.given[name]
        elif default is not None:
            scope.arguments[name] = self._text(default, scope)
        elif outermost:
            what = f"the argument {name!r} has no default: state {name}:=VALUE"
            self._reading.note(what, _where(element, scope))
        if outermost:
            self._reading.declared[name] = scope.arguments.get(name)

    def _env(self, element: Element, scope: _Scope) -> None:
        name = self._attribute(element, "name", scope)
        scope.environment[name] = self._attribute(element, "value", scope)
        self._reading.note(f"the environment variable {name} is left out", _where(element, scope))

    def _group(self, element: Element, scope: _Scope) -> None:
        self._remarks(element, scope)
        self._elements(element, scope.below(self._attribute(element, "ns", scope, "")))

    def _remap(self, element: Element, scope: _Scope) -> None:
        scope.remaps[self._attribute(element, "from", scope)] = self._attribute(element, "to", scope)

    def _include(self, element: Element, scope: _Scope) -> None:
        where = _where(element, scope)
        file = Path(self._attribute(element, "file", scope))
        file = file if file.is_absolute() else scope.file.parent / file
        passed = truth(self._attribute(element, "pass_all_args", scope, "false"))
        given = dict(scope.arguments) if passed else {}
        inner = scope.below(self._attribute(element, "ns", scope, ""))
        for each in element:
            if each.tag == "arg" and self._is_wanted(each, scope):
                name = self._attribute(each, "name", scope)
                value = each.get("value", each.get("default"))
                with self._noted(each, scope, f"the argument {name!r} is left out"):
                    given[name] = self._text(value or "", scope)
            elif each.tag == "env" and self._is_wanted(each, scope):
                self._env(each, inner)
        root = read_xml(file)
        if root.tag != "launch":
            raise UnresolvedError(f"{file} is no launch file of ROS 1: its root is <{root.tag}>")
        if self._reading.enter(file, where, inner.environment | given):
            self._elements(root, replace(inner, file=file, arguments={}, given=given))
            self._reading.leave()

    def _node(self, element: Element, scope: _Scope) -> None:
        where = _where(element, scope)
        inner = scope.below(self._attribute(element, "ns", scope, ""))
        name = self._attribute(element, "name", scope)
        own: dict[str, Any] = dict(scope.private)
        loaded = [*self._reading.open_files, *scope.loaded]
        for each in element:
            if not isinstance(each.tag, str):
                continue
            with self._noted(each, scope, f"<{each.tag}> of {name} is left out"):
                if not self._is_wanted(each, scope):
                    continue
                if each.tag == "param":
                    self._param(each, inner, own)
                elif each.tag == "rosparam":
                    self._rosparam(each, inner, own)
                    loaded.append(Path(self._attribute(each, "file", scope, "")).name)
                elif each.tag in ("remap", "env"):
                    self._element(each, inner)
                else:
                    self._reading.note(f"<{each.tag}> of a node is left out", _where(each, scope))
        self._remarks(element, scope)
        delay = self._attribute(element, "respawn_delay", scope, "0")
        node = LaunchedNode(
            self._attribute(element, "pkg", scope),
            self._attribute(element, "type", scope),
            name,
            inner.namespace,
            where,
            1,
            inner.remaps,
            flat(own, "/"),
            tuple(_words(self._attribute(element, "args", scope, ""))),
            required=truth(self._attribute(element, "required", scope, "false")),
            respawn=truth(self._attribute(element, "respawn", scope, "false")),
            respawn_delay=float(delay) if _is_number(delay) else 0.0,
            files=tuple(loaded),
        )
        self._reading.nodes.append(node)

    def _remarks(self, element: Element, scope: _Scope) -> None:
        where = _where(element, scope)
        for name, what in _WITHOUT_EFFECT.items():
            if name in element.attrib:
                self._reading.note(what, where, lost=False)
        for name, what in _NOT_MAPPED.items():
            if element.get(name):
                self._reading.note(what, where)

    # -- parameters

    def _param(self, element: Element, scope: _Scope, own: dict[str, Any] | None) -> None:
        name = self._attribute(element, "name", scope)
        kind = self._attribute(element, "type", scope, "auto")
        if "command" in element.attrib:
            raise UnresolvedError(f"parameter {name}: no command is executed")
        if "binfile" in element.attrib:
            raise UnresolvedError(f"parameter {name}: a file of bytes is no value of a model")
        if "textfile" in element.attrib:
            value: Any = file_text(Path(self._attribute(element, "textfile", scope)))
        else:
            value = _converted(self._attribute(element, "value", scope), kind, f"parameter {name}")
        self._set(name, value, scope, own)

    def _rosparam(self, element: Element, scope: _Scope, own: dict[str, Any] | None) -> None:
        command = self._attribute(element, "command", scope, "load")
        if command != "load":
            raise UnresolvedError(f"command {command!r}: parameters are only loaded")
        file = self._attribute(element, "file", scope, "")
        text = file_text(scope.file.parent / file) if file else "".join(element.itertext())
        if truth(self._attribute(element, "subst_value", scope, "false")):
            text = self._text(text, scope)
        value = yaml_value(text, file or str(scope.file))
        prefix = [self._attribute(element, key, scope, "") for key in ("ns", "param")]
        name = "/".join(part for part in prefix if part)
        if name:
            self._set(name, value, scope, own)
            return
        if value is None:
            return
        if not isinstance(value, dict):
            raise UnresolvedError("its values have no names: state `param`")
        for key, below in value.items():
            self._set(key, below, scope, own)

    def _set(self, name: str, value: Any, scope: _Scope, own: dict[str, Any] | None) -> None:
        """Set a parameter where it is stated: of a node, of the nodes that follow, or of no node."""
        values = value if isinstance(value, dict) and value else {"": value}
        leaves = {f"{name}/{key}".rstrip("/"): below for key, below in flat(values, "/").items()}
        for key, below in leaves.items():
            if key.startswith("/"):
                self._reading.shared[joined("/", key)] = below
            elif own is not None:
                own[key.removeprefix("~")] = below
            elif key.startswith("~"):
                scope.private[key.removeprefix("~")] = below
            else:
                self._reading.shared[joined(scope.namespace, key)] = below


def read_xml(file: Path) -> Element:
    """Return the root element of a launch file. Raises ``UnresolvedError``, or ``ModelError`` for no XML."""
    return xml_root(file_text(file).encode(), str(file), keep_blanks=True)


def _where(element: Element, scope: _Scope) -> Location:
    return Location(str(scope.file), element.sourceline or 1)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _words(text: str) -> list[str]:
    try:
        return shlex.split(text)
    except ValueError:
        return text.split()


def _typed(text: str) -> Any:
    """Return the value of a text of type ``auto``, as roslaunch converts it."""
    try:
        if "." in text:
            return float(text)
        if "_" not in text:
            return int(text)
    except ValueError:
        pass
    return text.lower() == "true" if text.lower() in ("true", "false") else text


def _converted(text: str, kind: str, what: str) -> Any:
    """Return the value of a parameter, as roslaunch converts it: without space around it."""
    text = text.strip()
    if kind == "auto":
        return _typed(text)
    if kind in ("str", "string"):
        return text
    if kind == "yaml":
        return yaml_value(text, what)
    if kind in ("bool", "boolean"):
        return truth(text)
    try:
        return {"int": int, "double": float, "float": float}[kind](text)
    except (KeyError, ValueError):
        raise UnresolvedError(f"{what}: {text!r} is no {kind}") from None
