"""Launch files of ROS 2 in Python: read over their syntax tree and never executed.

What a file declares is understood: actions and substitutions, lists that are built step by step, functions of
the file itself (also those of ``OpaqueFunction``), conditions and loops over known values. All else stays
unknown, and an action that needs it is noted with its line.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from volery.base.errors import Location, ModelError
from volery.exchange.launch import ros2_actions as actions
from volery.exchange.launch.expressions import FUNCTIONS, Evaluator, UnknownValue, evaluated
from volery.exchange.launch.launch_reading import (
    UnresolvedError,
    environment_variable,
    file_text,
    truth,
    yaml_value,
)
from volery.exchange.launch.ros2_actions import Action, LaunchNode, LaunchScope, NotMapped, Substitution
from volery.exchange.launch.ros2_markup import OUTPUT, PREFIX

ENTRY = "generate_launch_description"
DEEPEST_CALLS = 30


@dataclass
class Description:
    """A ``LaunchDescription``: actions in order."""

    actions: list[Any]


@dataclass(frozen=True)
class _Named:
    """A module, a class or a function that the file imports, by its dotted name."""

    name: str


@dataclass(frozen=True)
class _Function:
    """A function of the file."""

    node: ast.FunctionDef | ast.Lambda
    names: Mapping[str, Any]


@dataclass(frozen=True)
class _Opened:
    """A file that is opened for reading."""

    file: Path


@dataclass(frozen=True)
class _IncludedFile:
    """A source of an included launch file."""

    file: Any


class _ReturnedError(Exception):
    """A function returns."""

    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


def _print(*words: Any, **how: Any) -> None:
    """Print nothing: a launch file is read, not run."""


class PythonLaunch(Evaluator):
    """Evaluates one launch file in Python within *scope*."""

    def __init__(self, file: Path, scope: LaunchScope) -> None:
        super().__init__({"__file__": str(file), "open": self._open, "print": _print})
        self.names["Path"] = _Named("pathlib.Path")
        self._file = file
        self.scope = scope
        self._depth = 0
        self._environment = dict(os.environ) | scope.environment

    def read(self) -> None:
        """Visit what ``generate_launch_description`` returns.

        Raises:
            UnresolvedError: the file has no such function, or it returns nothing that is known.
            ModelError: it is not Python.
        """
        text = file_text(self._file)
        try:
            tree = ast.parse(text, str(self._file))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = getattr(error, "lineno", None) or 1
            what = f"not Python: {getattr(error, 'msg', error)}"
            raise ModelError(what, "", Location(str(self._file), line)) from None
        try:
            self.execute(tree.body)
            entry = self.names.get(ENTRY)
            if not isinstance(entry, _Function):
                raise UnresolvedError(f"there is no function {ENTRY}")
            made = self.called(entry, [], {})
        except RecursionError:
            raise UnresolvedError("it computes for too long") from None
        if isinstance(made, UnknownValue):
            raise UnresolvedError(f"{ENTRY}: {made.why}")
        if not isinstance(made, Description):
            raise UnresolvedError(f"{ENTRY} returns no LaunchDescription that is known without executing it")
        actions.visit_all(made.actions, self.scope)

    def _where(self, node: ast.AST) -> Location:
        return Location(str(self._file), getattr(node, "lineno", 1))

    def note(self, what: str, where: Location) -> None:
        """Record what is left out."""
        self.scope.reading.note(what, where)

    def _note(self, what: str, node: ast.AST) -> None:
        self.note(what, self._where(node))

    # -- statements

    def execute(self, body: list[ast.stmt]) -> None:
        """Follow statements in order."""
        for statement in body:
            self.step()
            follow = getattr(self, f"_follow_{type(statement).__name__.lower()}", None)
            if follow is not None:
                follow(statement)

    def _follow_import(self, node: ast.Import) -> None:
        for alias in node.names:
            name = alias.name if alias.asname else alias.name.partition(".")[0]
            self.names[alias.asname or name] = _Named(name)

    def _follow_importfrom(self, node: ast.ImportFrom) -> None:
        for alias in node.names:
            self.names[alias.asname or alias.name] = _Named(f"{node.module or ''}.{alias.name}")

    def _follow_functiondef(self, node: ast.FunctionDef) -> None:
        self.names[node.name] = _Function(node, self.names)

    def _follow_assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _follow_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.value(node.value))

    def _follow_augassign(self, node: ast.AugAssign) -> None:
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        before, value = self.value(load), self.value(node.value)
        if isinstance(before, list) and isinstance(value, list | tuple):
            before.extend(value)
        else:
            self.assign(node.target, self.combined(type(node.op), before, value))

    def _follow_expr(self, node: ast.Expr) -> None:
        value = self.value(node.value)
        if isinstance(value, UnknownValue) and isinstance(node.value, ast.Call):
            self._note(f"`{_short(node)}` is left out: {value.why}", node)

    def _follow_return(self, node: ast.Return) -> None:
        raise _ReturnedError(None if node.value is None else self.value(node.value))

    def _follow_if(self, node: ast.If) -> None:
        test = self.value(node.test)
        if isinstance(test, UnknownValue):
            self._note(f"`if {_short(node.test)}` is left out with what depends on it: {test.why}", node)
        else:
            self.execute(node.body if test else node.orelse)

    def _follow_for(self, node: ast.For) -> None:
        values = self.value(node.iter)
        if isinstance(values, UnknownValue) or not isinstance(values, list | tuple | dict | str):
            why = values.why if isinstance(values, UnknownValue) else "its values are not known"
            self._note(f"`for {_short(node.target)}` is left out: {why}", node)
            return
        for value in list(values):
            self.assign(node.target, value)
            self.execute(node.body)

    def _follow_while(self, node: ast.While) -> None:
        self._note("a `while` loop is left out", node)

    def _follow_with(self, node: ast.With) -> None:
        for item in node.items:
            value = self.value(item.context_expr)
            if item.optional_vars is not None:
                self.assign(item.optional_vars, value)
        self.execute(node.body)

    def _follow_try(self, node: ast.Try) -> None:
        self.execute([*node.body, *node.orelse, *node.finalbody])

    # -- values

    def _lambda(self, node: ast.Lambda) -> Any:
        return _Function(node, self.names)

    def attribute(self, owner: Any, name: str) -> Any:
        """See ``Evaluator``: also parts of modules and of launch's objects."""
        if isinstance(owner, _Named):
            dotted = f"{owner.name}.{name}"
            return self._environment if dotted == "os.environ" else _CONSTANTS.get(dotted, _Named(dotted))
        if isinstance(owner, Description) and name in ("add_action", "add_entity"):
            return owner.actions.append
        if isinstance(owner, Substitution) and name in ("perform", "find"):
            methods = {
                "perform": lambda *context: self._performed(owner),
                "find": lambda package: str(self.scope.folder_of(package)),
            }
            return methods[name]
        if isinstance(owner, _Opened) and name == "read":
            return lambda: file_text(owner.file)
        if isinstance(owner, PurePath) and name in ("resolve", "absolute", "expanduser"):
            return lambda: owner
        return super().attribute(owner, name)

    def call(self, function: Any, arguments: list[Any], named: dict[str, Any], node: ast.Call) -> Any:
        """See ``Evaluator``: also functions of the file, and launch's classes."""
        if function is _print:
            return None
        if isinstance(function, _Function):
            return self.called(function, arguments, named)
        if isinstance(function, _Named):
            return self._constructed(function.name, arguments, named, node)
        if function == getattr(getattr(function, "__self__", None), "append", None):
            function(arguments[0])  # an action, or what stands for one, also where parts of it are unknown
            return None
        return super().call(function, arguments, named, node)

    def called(self, function: _Function, arguments: list[Any], named: dict[str, Any]) -> Any:
        """Return what a function of the file returns."""
        if self._depth >= DEEPEST_CALLS:
            return UnknownValue("functions call each other too deeply")
        spec = function.node.args
        outer, self.names = self.names, dict(function.names)
        self._depth += 1
        try:
            every = [*spec.posonlyargs, *spec.args]
            defaults = dict(zip(reversed([one.arg for one in every]), reversed(spec.defaults), strict=False))
            keywords = zip(spec.kwonlyargs, spec.kw_defaults, strict=True)
            defaults |= {one.arg: default for one, default in keywords if default is not None}
            self.names |= {name: self.value(default) for name, default in defaults.items()}
            self.names |= dict(zip((one.arg for one in every), arguments, strict=False)) | named
            if isinstance(function.node, ast.Lambda):
                return self.value(function.node.body)
            self.execute(function.node.body)
        except _ReturnedError as returned:
            return returned.value
        finally:
            self.names = outer
            self._depth -= 1
        return None

    def joined(self, parts: list[Any]) -> Any:
        """See ``Evaluator``: a text with substitutions in it is one."""
        if any(isinstance(each, Substitution) for each in parts):
            return UnknownValue("a substitution within a formatted text has no value there")
        return super().joined(parts)

    def _performed(self, value: Any) -> Any:
        return actions.text(value, self.scope)

    def _open(self, file: Any, *mode: Any, **how: Any) -> Any:
        if mode and "r" not in str(mode[0]):
            return UnknownValue("a launch file is read without writing files")
        return _Opened(Path(actions.text(str(file), self.scope)))

    def _constructed(self, name: str, arguments: list[Any], named: dict[str, Any], node: ast.Call) -> Any:
        """Return what a class or a function of launch, ament or Python's library makes."""
        short = name.rpartition(".")[2]
        where = self._where(node)
        for table, key in ((_FUNCTIONS, name), (_FUNCTIONS, short), (_ACTIONS, short)):
            maker = table.get(key)
            if maker is not None:
                return maker(_PythonCall(self, where, arguments, named))
        if name.startswith(("launch.", "launch_ros.", "launch_testing", "nav2_common")):
            return NotMapped(where, f"{short} is left out")
        return UnknownValue(f"`{_short(node)}` is not evaluated")


@dataclass
class _PythonCall:
    """A call of a class or a function: its place and its arguments."""

    launch: PythonLaunch
    where: Location
    arguments: list[Any]
    named: dict[str, Any]

    def get(self, name: str, position: int = -1, default: Any = None) -> Any:
        """Return an argument by its name or its position."""
        if name in self.named:
            return self.named[name]
        return self.arguments[position] if 0 <= position < len(self.arguments) else default

    def plain(self, name: str, position: int = -1, default: Any = "") -> str:
        """Return the text of an argument that must be known now. Raises ``UnresolvedError``."""
        return actions.text(self.get(name, position, default), self.launch.scope)

    @property
    def condition(self) -> Substitution | None:
        """The condition of an action."""
        stated = self.named.get("condition")
        if isinstance(stated, UnknownValue):
            return actions.unresolved(stated.why)
        return stated if isinstance(stated, Substitution) else None

    def items(self, value: Any) -> list[Any]:
        """Return a list that an argument is."""
        return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]


def _short(node: ast.AST) -> str:
    words = " ".join(ast.unparse(node).split())
    return words if len(words) <= 60 else f"{words[:57]}..."


# -- actions


def _node(call: _PythonCall) -> list[Action]:
    made: list[Action] = []
    if call.named.get("output") is not None:
        made.append(NotMapped(call.where, OUTPUT, lost=False))
    if call.named.get("prefix") is not None:
        made.append(NotMapped(call.where, PREFIX))
    for key in ("additional_env", "env", "exec_name", "sigterm_timeout"):
        if call.named.get(key) is not None and key != "exec_name":
            made.append(NotMapped(call.where, f"`{key}` of a node is left out"))
    ros_arguments = call.items(call.named.get("ros_arguments"))
    required = isinstance(call.named.get("on_exit"), NotMapped | list)
    node = LaunchNode(
        call.where,
        call.get("package"),
        call.get("executable", default=call.get("node_executable")),
        call.get("name", default=call.get("node_name")),
        call.get("namespace", default=call.get("node_namespace")),
        call.items(call.get("parameters")),
        call.items(call.get("remappings")),
        [*call.items(call.get("arguments")), *(["--ros-args", *ros_arguments] if ros_arguments else [])],
        plugin=call.get("plugin", default=call.get("node_plugin")),
        respawn=call.get("respawn"),
        respawn_delay=call.get("respawn_delay"),
        required=required,
        composable=_flat_nodes(call.get("composable_node_descriptions")),
        condition=call.condition,
    )
    return [*made, node]


def _flat_nodes(value: Any) -> list[LaunchNode]:
    """Return the composable nodes of a list; each was made with its remarks."""
    if isinstance(value, list | tuple):
        return [node for each in value for node in _flat_nodes(each)]
    return [value] if isinstance(value, LaunchNode) else []


def _composable(call: _PythonCall) -> Any:
    return _node(call)[-1]


def _container(call: _PythonCall) -> list[Action]:
    return _node(call)


def _load_composable(call: _PythonCall) -> Action:
    target = call.get("target_container", 1)
    if isinstance(target, list):  # a container with its remarks
        target = next((one for one in target if isinstance(one, LaunchNode)), target)
    nodes = _flat_nodes(call.get("composable_node_descriptions", 0))
    return actions.LoadComposable(call.where, target, nodes, condition=call.condition)


def _include(call: _PythonCall) -> Action:
    source = call.get("launch_description_source", 0)
    file = source.file if isinstance(source, _IncludedFile) else source
    stated = call.get("launch_arguments", default=())
    pairs = list(stated.items()) if isinstance(stated, dict) else stated
    if isinstance(pairs, UnknownValue) or not all(
        isinstance(pair, list | tuple) and len(pair) == 2 for pair in pairs
    ):
        why = pairs.why if isinstance(pairs, UnknownValue) else "its arguments are not known"
        return actions.Include(call.where, actions.unresolved(why), condition=call.condition)
    return actions.Include(call.where, file, [tuple(pair) for pair in pairs], condition=call.condition)


def _group(call: _PythonCall) -> Action:
    listed = call.get("actions", 0)
    if isinstance(listed, UnknownValue):
        return NotMapped(call.where, f"a group is left out: {listed.why}")
    scoped = call.get("scoped", default=True) is not False
    forwarded = call.get("launch_configurations")
    lets = [actions.Let(call.where, key, value) for key, value in (forwarded or {}).items()]
    return actions.ActionGroup(call.where, [*lets, *call.items(listed)], scoped, condition=call.condition)


def _timer(call: _PythonCall) -> list[Action]:
    return [
        NotMapped(call.where, "TimerAction: its nodes start with the others", lost=False),
        actions.ActionGroup(
            call.where, call.items(call.get("actions")), scoped=False, condition=call.condition
        ),
    ]


def _event_handler(call: _PythonCall) -> list[Action]:
    """Return the actions of ``OnProcessStart`` and the like, which start later; one of an end is a remark."""
    handler = call.get("event_handler", 0)
    listed = handler if isinstance(handler, list) else []
    remark = NotMapped(
        call.where, "RegisterEventHandler: what it starts starts with the others", lost=not listed
    )
    return [remark, actions.ActionGroup(call.where, listed, scoped=False, condition=call.condition)]


def _after_start(call: _PythonCall) -> list[Any]:
    later = call.get("on_start", default=call.get("on_completion", default=call.get("on_exit")))
    return [item for item in call.items(later) if isinstance(item, Action | list)]


@dataclass
class _Opaque(Action):
    """A function of the file that is called when the action is visited, and returns actions."""

    launch: PythonLaunch | None = None
    function: Any = None
    arguments: Any = ()
    named: Any = None

    noun = "an OpaqueFunction"

    def visit(self, scope: LaunchScope) -> None:
        """See ``Action``."""
        assert self.launch is not None
        if not isinstance(self.function, _Function):
            raise UnresolvedError("its function is not in the file")
        before, self.launch.scope = self.launch.scope, scope
        try:
            made = self.launch.called(self.function, ["context", *self.arguments], dict(self.named or {}))
            if isinstance(made, UnknownValue):
                raise UnresolvedError(made.why)
            actions.visit_all(made if isinstance(made, list) else [made], scope)
        finally:
            self.launch.scope = before


def _opaque(call: _PythonCall) -> Action:
    return _Opaque(
        call.where,
        call.launch,
        call.get("function", 0),
        call.items(call.get("args", 1)),
        call.get("kwargs", 2),
        condition=call.condition,
    )


def _ignored(what: str, *, lost: bool = True) -> Callable[[_PythonCall], Action]:
    return lambda call: NotMapped(call.where, what, lost, condition=call.condition)


_ACTIONS: Mapping[str, Callable[[_PythonCall], Any]] = {
    "LaunchDescription": lambda call: Description(call.items(call.get("initial_entities", 0))),
    "DeclareLaunchArgument": lambda call: actions.Declare(
        call.where, call.get("name", 0), call.get("default_value", 1), condition=call.condition
    ),
    "SetLaunchConfiguration": lambda call: actions.Let(
        call.where, call.get("name", 0), call.get("value", 1), condition=call.condition
    ),
    "Node": _node,
    "LifecycleNode": _node,
    "ComposableNodeContainer": _container,
    "ComposableNode": _composable,
    "LoadComposableNodes": _load_composable,
    "IncludeLaunchDescription": _include,
    "GroupAction": _group,
    "TimerAction": _timer,
    "RosTimer": _timer,
    "OpaqueFunction": _opaque,
    "PushRosNamespace": lambda call: actions.PushNamespace(
        call.where, call.get("namespace", 0), condition=call.condition
    ),
    "PushROSNamespace": lambda call: actions.PushNamespace(
        call.where, call.get("namespace", 0), condition=call.condition
    ),
    "SetRemap": lambda call: actions.SetRemap(
        call.where, call.get("src", 0), call.get("dst", 1), condition=call.condition
    ),
    "SetParameter": lambda call: actions.SetParameter(
        call.where, call.get("name", 0), call.get("value", 1), condition=call.condition
    ),
    "SetUseSimTime": lambda call: actions.SetParameter(
        call.where, "use_sim_time", call.get("value", 0), condition=call.condition
    ),
    "SetParametersFromFile": lambda call: actions.SetParameterFile(
        call.where, call.get("filename", 0), condition=call.condition
    ),
    "SetEnvironmentVariable": lambda call: actions.SetEnvironment(
        call.where, call.get("name", 0), call.get("value", 1), condition=call.condition
    ),
    "RegisterEventHandler": _event_handler,
    "OnProcessStart": _after_start,
    "OnProcessExit": _after_start,
    "OnExecutionComplete": _after_start,
    "Shutdown": _ignored("Shutdown is left out", lost=False),
    "EmitEvent": _ignored("EmitEvent is left out"),
    "LogInfo": _ignored("LogInfo is left out", lost=False),
    "ExecuteProcess": _ignored("ExecuteProcess is left out: it is no node"),
    "ExecuteLocal": _ignored("ExecuteLocal is left out: it is no node"),
}


# -- substitutions and functions


def _python_expression(call: _PythonCall) -> Substitution:
    parts = call.get("expression", 0)
    return Substitution(lambda scope: _as_text(evaluated(actions.text(parts, scope), {})))


def _as_text(value: Any) -> str:
    return str(value)


def _equals(call: _PythonCall, *, negated: bool = False) -> Substitution:
    one, other = call.get("left", 0), call.get("right", 1)
    return Substitution(lambda scope: (actions.text(one, scope) == actions.text(other, scope)) is not negated)


def _configuration_equals(call: _PythonCall, *, negated: bool = False) -> Substitution:
    name, wanted = call.get("launch_configuration_name", 0), call.get("expected_value", 1)

    def resolve(scope: LaunchScope) -> bool:
        stated = scope.arguments.get(actions.text(name, scope))
        return (stated == (None if wanted is None else actions.text(wanted, scope))) is not negated

    return Substitution(resolve)


def _combined(call: _PythonCall, combine: Callable[[Any], bool]) -> Substitution:
    listed = [item for each in call.arguments for item in call.items(each)]
    return Substitution(lambda scope: str(combine(truth(actions.text(one, scope)) for one in listed)).lower())


def _parameter_value(call: _PythonCall) -> actions.Typed:
    kind = call.get("value_type", 1)
    return actions.Typed(call.get("value", 0), kind if kind in (int, float, bool) else _stated_type(kind))


def _stated_type(kind: Any) -> type | None:
    return str if kind is FUNCTIONS["str"] else None


def _path_exists(call: _PythonCall) -> bool:
    return Path(call.plain("path", 0)).exists()


def _joined_path(call: _PythonCall) -> Any:
    if any(isinstance(argument, Substitution | list) for argument in call.arguments):
        return actions.path_join(call.arguments)
    unknown = next((argument for argument in call.arguments if isinstance(argument, UnknownValue)), None)
    return unknown or os.path.join(*map(str, call.arguments))  # noqa: PTH118  # "" at the end makes a slash


def _loaded(call: _PythonCall) -> Any:
    source = call.get("stream", 0)
    if isinstance(source, _Opened):
        return yaml_value(file_text(source.file), str(source.file))
    return source if isinstance(source, UnknownValue) else yaml_value(str(source), "YAML")


def _has_resource(call: _PythonCall) -> bool | UnknownValue:
    """Return whether there is a package; other resources of the index are not known."""
    if call.plain("resource_type", 0) != "packages":
        return UnknownValue("only packages are looked for in ament's index")
    try:
        return bool(call.launch.scope.folder_of(call.plain("resource_name", 1)))
    except UnresolvedError:
        return False


def _share(call: _PythonCall) -> str:
    return str(call.launch.scope.folder_of(call.plain("package_name", 0)))


def _rewritten(call: _PythonCall) -> Any:
    """Return the file of nav2's ``RewrittenYaml``, without the changes."""
    what = "RewrittenYaml: its changes are left out, and the parameters are those of the file"
    call.launch.note(what, call.where)
    return call.get("source_file", 0)


_FUNCTIONS: Mapping[str, Callable[[_PythonCall], Any]] = {
    "LaunchConfiguration": lambda call: actions.argument(
        call.get("variable_name", 0), call.get("default", default=None)
    ),
    "TextSubstitution": lambda call: call.get("text", 0),
    "FindPackageShare": lambda call: actions.package_share(call.get("package", 0)),
    "FindPackagePrefix": lambda call: actions.package_share(call.get("package", 0)),
    "FindPackage": lambda call: actions.package_share(call.get("package", 0)),
    "PathJoinSubstitution": lambda call: actions.path_join(call.items(call.get("substitutions", 0))),
    "PathJoin": lambda call: actions.path_join(call.items(call.get("substitutions", 0))),
    "FileContent": lambda call: actions.file_content(call.get("path", 0)),
    "EnvironmentVariable": lambda call: actions.environment(
        call.get("name", 0), call.get("default_value", default=None)
    ),
    "ThisLaunchFileDir": lambda call: Substitution(lambda scope: str(scope.file.parent)),
    "ThisLaunchFile": lambda call: Substitution(lambda scope: str(scope.file)),
    "AnonName": lambda call: actions.anonymous(call.get("name", 0)),
    "Command": lambda call: actions.unresolved("no command is executed"),
    "FindExecutable": lambda call: actions.unresolved("no program is looked for"),
    "ExecutableInPackage": lambda call: actions.unresolved("no program is looked for"),
    "PythonExpression": _python_expression,
    "IfCondition": lambda call: actions.condition(call.get("predicate_expression", 0)),
    "UnlessCondition": lambda call: actions.condition(call.get("predicate_expression", 0), negated=True),
    "LaunchConfigurationEquals": _configuration_equals,
    "LaunchConfigurationNotEquals": lambda call: _configuration_equals(call, negated=True),
    "EqualsSubstitution": lambda call: _text_of(_equals(call)),
    "NotEqualsSubstitution": lambda call: _text_of(_equals(call, negated=True)),
    "NotSubstitution": lambda call: _combined(call, lambda values: not next(values)),
    "AndSubstitution": lambda call: _combined(call, all),
    "OrSubstitution": lambda call: _combined(call, any),
    "AllSubstitution": lambda call: _combined(call, all),
    "AnySubstitution": lambda call: _combined(call, any),
    "PythonLaunchDescriptionSource": lambda call: _IncludedFile(call.get("location", 0)),
    "XMLLaunchDescriptionSource": lambda call: _IncludedFile(call.get("location", 0)),
    "YAMLLaunchDescriptionSource": lambda call: _IncludedFile(call.get("location", 0)),
    "FrontendLaunchDescriptionSource": lambda call: _IncludedFile(call.get("location", 0)),
    "AnyLaunchDescriptionSource": lambda call: _IncludedFile(call.get("location", 0)),
    "ParameterValue": _parameter_value,
    "ParameterFile": lambda call: call.get("param_file", 0),
    "RewrittenYaml": _rewritten,
    "has_resource": _has_resource,
    "get_package_share_directory": _share,
    "get_package_share_path": lambda call: PurePath(_share(call)),
    "get_package_prefix": _share,
    "os.path.join": _joined_path,
    "os.path.dirname": lambda call: str(Path(call.plain("p", 0)).parent),
    "os.path.basename": lambda call: Path(call.plain("p", 0)).name,
    "os.path.abspath": lambda call: call.plain("path", 0),
    "os.path.realpath": lambda call: call.plain("path", 0),
    "os.path.expanduser": lambda call: str(Path(call.plain("path", 0)).expanduser()),
    "os.path.exists": _path_exists,
    "os.path.isfile": _path_exists,
    "os.path.splitext": lambda call: [
        call.plain("p", 0).removesuffix(Path(call.plain("p", 0)).suffix),
        Path(call.plain("p", 0)).suffix,
    ],
    "os.getenv": lambda call: environment_variable(call.plain("key", 0), call.plain("default", 1)),
    "pathlib.Path": lambda call: PurePath(call.plain("path", 0, ".")),
    "yaml.safe_load": _loaded,
    "yaml.load": _loaded,
}


_CONSTANTS: Mapping[str, Any] = {"os.pathsep": os.pathsep, "os.sep": os.sep, "os.name": os.name}


def _text_of(truth_value: Substitution) -> Substitution:
    return Substitution(lambda scope: str(truth_value.resolve(scope)).lower())
