"""What launch files of ROS 2 do, whatever they are written in: substitutions, conditions and actions.

The readers of XML, YAML and Python make these actions; visiting them in order gives the nodes, as ``launch``
does, but without a process. Values of arguments are looked up when an action is visited.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from volery.base.errors import Location
from volery.exchange.launch.expressions import UnknownValue
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

PARAMETERS = "ros__parameters"


@dataclass
class LaunchScope:
    """What holds while actions are visited: arguments, namespace, remappings and parameters of all nodes.

    ``read`` includes another launch file: it is given the file and this scope.
    """

    reading: LaunchReading
    file: Path
    read: Callable[[Path, LaunchScope, Location], None]
    arguments: dict[str, str] = field(default_factory=dict)
    namespace: str = "/"
    remaps: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)
    parameter_files: list[Path] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, str] = field(default_factory=dict)

    def inner(self) -> LaunchScope:
        """Return the scope of a group."""
        return replace(
            self,
            arguments=dict(self.arguments),
            remaps=dict(self.remaps),
            parameters=dict(self.parameters),
            parameter_files=list(self.parameter_files),
            environment=dict(self.environment),
        )

    def folder_of(self, package: str) -> Path:
        """Return the folder of a package. Raises ``UnresolvedError``."""
        return self.reading.folder_of(package, self.file)


@dataclass(frozen=True)
class Substitution:
    """A text that is known when an action is visited; ``typed`` one keeps the type of its result."""

    resolve: Callable[[LaunchScope], Any]
    name: str = ""


def _must_be_known(value: Any) -> None:
    if isinstance(value, UnknownValue | NotMapped):
        raise UnresolvedError(value.why if isinstance(value, UnknownValue) else value.what)


def resolved(value: Any, scope: LaunchScope) -> Any:
    """Return a value with all substitutions in it replaced. Raises ``UnresolvedError``."""
    _must_be_known(value)
    if isinstance(value, Substitution):
        return value.resolve(scope)
    if isinstance(value, list | tuple):
        return [resolved(each, scope) for each in value]
    if isinstance(value, Mapping):
        return {text(key, scope): resolved(below, scope) for key, below in value.items()}
    return value


def text(value: Any, scope: LaunchScope) -> str:
    """Return the text of a value: a list of texts and substitutions is joined. Raises ``UnresolvedError``."""
    if isinstance(value, list | tuple):
        return "".join(text(each, scope) for each in value)
    found = resolved(value, scope)
    if isinstance(found, list | tuple):
        return "".join(map(str, found))
    if isinstance(found, bool):
        return "true" if found else "false"
    return "" if found is None else str(found)


def argument(name: Any, default: Any = None) -> Substitution:
    """Return the value of an argument (``LaunchConfiguration``, ``$(var ...)``)."""

    def resolve(scope: LaunchScope) -> Any:
        key = text(name, scope)
        if key in scope.arguments:
            return scope.arguments[key]
        if default is not None:
            return text(default, scope)
        raise UnresolvedError(f"there is no argument {key!r}")

    return Substitution(resolve, name if isinstance(name, str) else "")


def package_share(name: Any) -> Substitution:
    """Return the folder of a package's files; of a source, its own folder."""
    return Substitution(lambda scope: str(scope.folder_of(text(name, scope))))


def path_join(parts: Iterable[Any]) -> Substitution:
    """Return parts joined as a path."""
    listed = list(parts)

    def resolve(scope: LaunchScope) -> str:
        return str(Path(*(text(each, scope) for each in listed)))

    return Substitution(resolve)


def environment(name: Any, default: Any = None) -> Substitution:
    """Return an environment variable."""

    def resolve(scope: LaunchScope) -> str:
        key = text(name, scope)
        if key in scope.environment:
            return scope.environment[key]
        return environment_variable(key, None if default is None else text(default, scope))

    return Substitution(resolve)


def anonymous(name: Any) -> Substitution:
    """Return a name with a number in place of a random one, so that a file gives one model."""

    def resolve(scope: LaunchScope) -> str:
        key = text(name, scope)
        return scope.numbers.setdefault(key, f"{key}_{len(scope.numbers) + 1}")

    return Substitution(resolve)


def file_content(path: Any) -> Substitution:
    """Return the text of a file."""
    return Substitution(lambda scope: file_text(Path(text(path, scope))))


def unresolved(why: str) -> Substitution:
    """Return a substitution that is not known."""

    def resolve(scope: LaunchScope) -> str:
        raise UnresolvedError(why)

    return Substitution(resolve)


# -- actions


@dataclass
class Action:
    """A step of a launch file. ``condition`` is None, or what must be true."""

    where: Location
    condition: Substitution | None = field(default=None, kw_only=True)

    noun = "an action"

    def visit(self, scope: LaunchScope) -> None:
        """Do what the action does to the nodes and to *scope*. Raises ``UnresolvedError``."""


def visit_all(actions: Iterable[Any], scope: LaunchScope) -> None:
    """Visit actions in order; what is not known of one is noted, and the others go on."""
    for action in actions:
        if isinstance(action, list | tuple):
            visit_all(action, scope)
        elif isinstance(action, Action):
            try:
                if action.condition is None or action.condition.resolve(scope):
                    action.visit(scope)
            except UnresolvedError as error:
                scope.reading.note(f"{action.noun} is left out: {error}", action.where)


def condition(value: Any, *, negated: bool = False) -> Substitution:
    """Return a condition: the truth of a text, or its opposite."""
    return Substitution(lambda scope: truth(text(value, scope)) is not negated)


def both(one: Substitution | None, other: Substitution | None) -> Substitution | None:
    """Return a condition that holds where both do."""
    if one is None or other is None:
        return one or other
    return Substitution(lambda scope: one.resolve(scope) and other.resolve(scope))


@dataclass
class NotMapped(Action):
    """What has no place in a model; *lost* is false where nothing of the system is missing."""

    what: str = ""
    lost: bool = True

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.reading.note(self.what, self.where, lost=self.lost)


@dataclass
class Declare(Action):
    """A declaration of an argument, with its default or None."""

    name: Any = ""
    default: Any = None

    noun = "the declaration of an argument"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        name = text(self.name, scope)
        outermost = len(scope.reading.open_files) == 1
        if outermost:
            scope.reading.declared[name] = None
        if name not in scope.arguments:
            if self.default is None:
                raise UnresolvedError(f"the argument {name!r} has no default: state {name}:=VALUE")
            scope.arguments[name] = text(self.default, scope)
        if outermost:
            scope.reading.declared[name] = scope.arguments[name]


@dataclass
class Let(Action):
    """A value of an argument that is set here."""

    name: Any = ""
    value: Any = ""

    noun = "a value of an argument"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.arguments[text(self.name, scope)] = text(self.value, scope)


@dataclass
class SetEnvironment(Action):
    """An environment variable, which conditions and paths of the file may use."""

    name: Any = ""
    value: Any = ""

    noun = "an environment variable"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        name = text(self.name, scope)
        scope.environment[name] = text(self.value, scope)
        scope.reading.note(f"the environment variable {name} is left out", self.where)


@dataclass
class PushNamespace(Action):
    """A namespace of what follows in the group."""

    namespace: Any = ""

    noun = "a namespace"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.namespace = joined(scope.namespace, text(self.namespace, scope))


@dataclass
class SetRemap(Action):
    """A remapping of the nodes that follow."""

    source: Any = ""
    target: Any = ""

    noun = "a remapping"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.remaps[text(self.source, scope)] = text(self.target, scope)


@dataclass
class SetParameter(Action):
    """A parameter of all nodes that follow."""

    name: Any = ""
    value: Any = None

    noun = "a parameter of all nodes"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.parameters[text(self.name, scope)] = parameter_value(self.value, scope)


@dataclass
class SetParameterFile(Action):
    """A file of parameters for the nodes that follow."""

    file: Any = ""

    noun = "a file of parameters"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        scope.parameter_files.append(Path(text(self.file, scope)))


@dataclass
class ActionGroup(Action):
    """Actions together; what they set holds in the group only if it is *scoped*."""

    actions: Sequence[Any] = ()
    scoped: bool = True

    noun = "a group"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        visit_all(self.actions, scope.inner() if self.scoped else scope)


@dataclass
class Include(Action):
    """Another launch file, with its arguments."""

    file: Any = ""
    arguments: Sequence[tuple[Any, Any]] = ()

    noun = "an included launch file"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        file = Path(text(self.file, scope))
        for name, value in self.arguments:
            scope.arguments[text(name, scope)] = text(value, scope)
        scope.read(file, scope, self.where)


@dataclass
class LaunchNode(Action):
    """A node, a container of composable nodes, or with ``plugin`` a composable node."""

    package: Any = None
    executable: Any = None
    name: Any = None
    namespace: Any = None
    parameters: Sequence[Any] = ()
    remaps: Sequence[tuple[Any, Any]] = ()
    arguments: Sequence[Any] = ()
    plugin: Any = None
    container: Any = None
    respawn: Any = False
    respawn_delay: Any = None
    required: bool = False
    composable: Sequence[Any] = ()
    is_split: bool = False
    """Whether each of its arguments is split into words, as the attribute ``args`` is."""

    noun = "a node"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        if self.executable is None and self.plugin is None:
            raise UnresolvedError("its executable is missing")
        name, namespace = self._named(scope)
        full = joined(namespace, name or text(self.executable or self.plugin, scope))
        parameters, files = self._parameters(scope, full, named=bool(name))
        words = [text(each, scope) for each in self.arguments]
        respawn = self.respawn
        delay = text(self.respawn_delay, scope)
        node = LaunchedNode(
            text(self.package, scope),
            text(self.executable if self.plugin is None else self.plugin, scope),
            name,
            namespace,
            self.where,
            2,
            {**scope.remaps, **self._remaps(scope)},
            parameters,
            tuple(word for one in words for word in (split_words(one) if self.is_split else [one])),
            text(self.container, scope),
            self.required,
            truth(text(respawn, scope) or "false"),
            float(delay) if re.fullmatch(r"\d+(\.\d*)?", delay) else 0.0,
            (*scope.reading.open_files, *files),
        )
        scope.reading.nodes.append(node)
        visit_all(
            [replace(one, container=full) for one in self.composable if isinstance(one, LaunchNode)], scope
        )

    def _named(self, scope: LaunchScope) -> tuple[str, str]:
        name = text(self.name, scope)
        own = text(self.namespace, scope)
        namespace = joined(scope.namespace, own) if own else scope.namespace
        return name, namespace

    def _remaps(self, scope: LaunchScope) -> dict[str, str]:
        return {text(source, scope): text(target, scope) for source, target in map(_pair, self.remaps)}

    def _parameters(self, scope: LaunchScope, full: str, *, named: bool) -> tuple[dict[str, Any], list[str]]:
        """Return the parameters of the node, and the names of the files that they are from.

        A node that is not *named* here has the name that its program states, which is not known.
        """
        made = dict(scope.parameters)
        names = []
        for each in (*scope.parameter_files, *self.parameters):
            stated = isinstance(each, Mapping)
            for key, value in each.items() if stated else [("", each)]:
                try:
                    if stated:
                        made |= flat({text(key, scope): parameter_value(value, scope)}, ".")
                    else:
                        file = Path(text(value, scope))
                        names.append(file.name)
                        own, others = parameters_of(file, full)
                        made |= own
                        if others and not named:
                            listed = ", ".join(others)
                            what = f"parameters of {listed} are left out: no name is stated for {full}"
                            scope.reading.note(what, self.where)
                except UnresolvedError as error:
                    what = f"the parameter {key} of {full} is" if stated else f"parameters of {full} are"
                    scope.reading.note(f"{what} left out: {error}", self.where)
        return {key: value for key, value in made.items() if value is not None}, names


@dataclass
class LoadComposable(Action):
    """Composable nodes that are loaded into a container which another action starts."""

    target: Any = ""
    composable: Sequence[Any] = ()

    noun = "composable nodes"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        target = self.target
        container = text(target.name if isinstance(target, LaunchNode) else target, scope)
        full = joined(scope.namespace, container)
        visit_all(
            [replace(one, container=full) for one in self.composable if isinstance(one, LaunchNode)], scope
        )


def _pair(value: Any) -> tuple[Any, Any]:
    if isinstance(value, list | tuple) and len(value) == 2:
        return value[0], value[1]
    why = value.why if isinstance(value, UnknownValue) else "a remapping has two names"
    raise UnresolvedError(why)


def split_words(words: str) -> list[str]:
    """Return the words of a command line."""
    try:
        return shlex.split(words)
    except ValueError:
        return words.split()


@dataclass(frozen=True)
class Typed:
    """The value of a parameter with its type stated; None for that which its text has in YAML."""

    value: Any
    type: type | None = None


def parameter_value(value: Any, scope: LaunchScope) -> Any:
    """Return the value of a parameter: a text that substitutions gave has the type that YAML reads."""
    _must_be_known(value)
    if isinstance(value, Typed):
        found = text(value.value, scope)
        read = found if value.type is str else yaml_value(found, str(scope.file))
        return value.type(read) if value.type in (int, float, bool) else read
    if isinstance(value, Substitution) or _is_one_text(value):
        read = yaml_value(text(value, scope), str(scope.file))
        return "" if read is None else read  # as launch_ros has it
    if isinstance(value, list | tuple):
        return [parameter_value(each, scope) for each in value]
    if isinstance(value, Mapping):
        return {text(key, scope): parameter_value(below, scope) for key, below in value.items()}
    return value


def _is_one_text(value: Any) -> bool:
    """Return whether a list is the parts of one text: texts and at least one substitution."""
    return (
        isinstance(value, list | tuple)
        and all(isinstance(each, str | Substitution) for each in value)
        and any(isinstance(each, Substitution) for each in value)
    )


def parameters_of(file: Path, node: str) -> tuple[dict[str, Any], list[str]]:
    """Return the parameters of a file for the *node* of this full name, and the names of other nodes.

    Keys are names of nodes, with ``*`` for one part and ``/**`` for any number of parts of a name.

    Raises:
        UnresolvedError: the file cannot be read, or has no parameters.
    """
    made: dict[str, Any] = {}
    others: list[str] = []
    tree = yaml_value(file_text(file), str(file), merges=True)
    if not isinstance(tree, dict):
        raise UnresolvedError(f"{file} has no parameters")
    if not _has_parameters(tree):
        raise UnresolvedError(f"{file} has no key {PARAMETERS!r}")
    for pattern, values in _sections(tree, ""):
        if _pattern(pattern).fullmatch(node.strip("/")):
            made |= flat(values, ".")
        else:
            others.append(pattern)
    return made, others


def _pattern(name: str) -> re.Pattern[str]:
    """Return what the full names of nodes match, without the first slash."""
    parts = [part for part in name.split("/") if part]
    made = ""
    for number, part in enumerate(parts, 1):
        last = number == len(parts)
        if part == "**":
            made += ".*" if last else "(?:[^/]+/)*"
        else:
            made += ("[^/]+" if part == "*" else re.escape(part)) + ("" if last else "/")
    return re.compile(made)


def _has_parameters(tree: Mapping[str, Any]) -> bool:
    return any(
        key == PARAMETERS or (isinstance(below, Mapping) and _has_parameters(below))
        for key, below in tree.items()
    )


def _sections(tree: Mapping[str, Any], name: str) -> Iterable[tuple[str, Mapping[str, Any]]]:
    for key, below in tree.items():
        if key == PARAMETERS:
            if isinstance(below, Mapping):
                yield name, below
        elif isinstance(below, Mapping):
            yield from _sections(below, f"{name}/{key}".replace("//", "/") if name else key)
