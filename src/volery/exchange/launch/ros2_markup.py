"""Launch files of ROS 2 in XML and YAML: entities with attributes and children become actions.

The grammar is that of launch's front ends (design.ros2.org, "ROS 2 Launch XML Format", and launch_yaml).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from volery.base.errors import Location, ModelError
from volery.exchange.launch import ros2_actions as actions
from volery.exchange.launch.expressions import evaluated
from volery.exchange.launch.launch_reading import UnresolvedError, file_text, truth
from volery.exchange.launch.ros2_actions import Action, LaunchNode, LaunchScope, NotMapped, Substitution
from volery.exchange.xml_text import Element
from volery.model.text import TextNode as YamlNode
from volery.model.text import parse as parse_yaml

DEEPEST_SUBSTITUTION = 20
OUTPUT = "`output`: a run shows the warnings and errors of all nodes"
PREFIX = "`launch-prefix` is left out"


@dataclass(frozen=True)
class Entity:
    """An element of XML, or an entry of YAML."""

    kind: str
    where: Location
    attributes: Mapping[str, str] = field(default_factory=dict)
    children: tuple[Entity, ...] = ()

    def get(self, name: str) -> Any:
        """Return the template of an attribute, or None."""
        return template(self.attributes[name]) if name in self.attributes else None

    def need(self, name: str) -> Any:
        """Return the template of an attribute that must be there."""
        if name not in self.attributes:
            return [actions.unresolved(f"<{self.kind}> has no attribute {name!r}")]
        return template(self.attributes[name])

    def all(self, *kinds: str) -> list[Entity]:
        """Return the children of these kinds."""
        return [child for child in self.children if child.kind in kinds]


def xml_entity(element: Element, file: Path) -> Entity:
    """Return an element of XML with all below it."""
    children = tuple(xml_entity(each, file) for each in element if isinstance(each.tag, str))
    kind = element.tag.replace("-", "_")
    return Entity(kind, Location(str(file), element.sourceline or 1), dict(element.attrib), children)


def yaml_entity(file: Path) -> Entity:
    """Return the entities of a YAML file. Raises ``UnresolvedError`` or ``ModelError``."""
    root = parse_yaml(file_text(file), str(file))
    listed = root.child("launch")
    if listed is None or not isinstance(listed.value, list):
        raise ModelError("a launch file in YAML has a list `launch`", "", Location(str(file), 1))
    return Entity("launch", root.where, {}, tuple(_yaml_entries(listed)))


def _yaml_entries(listed: YamlNode) -> Iterator[Entity]:
    for item in listed.value if isinstance(listed.value, list) else ():
        for kind, below in item.items.items():
            yield _yaml_one(kind, below)


def _yaml_one(kind: str, node: YamlNode) -> Entity:
    kind = kind.replace("-", "_")
    if isinstance(node.value, list):
        return Entity(kind, node.where, {}, tuple(_yaml_entries(node)))
    attributes: dict[str, str] = {}
    children: list[Entity] = []
    for key, below in node.items.items():
        if key == "children":
            children += _yaml_entries(below)
        elif isinstance(below.value, list) and all(isinstance(one.value, dict) for one in below.value):
            children += [_yaml_one(key, one) for one in below.value]
        else:
            attributes[key] = _yaml_text(below)
    return Entity(kind, node.where, attributes, tuple(children))


def _yaml_text(node: YamlNode) -> str:
    value = node.plain()
    if isinstance(value, list):
        return "[" + ", ".join(map(str, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else "" if value is None else str(value)


# -- substitutions in texts


def template(text: str) -> list[Any]:
    """Return the parts of a text: texts and substitutions, ``$(name argument 'argument')``."""
    return _parts(text, 0, "", 0)[0]


def _parts(text: str, position: int, ends: str, depth: int) -> tuple[list[Any], int]:
    """Return parts from *position* on, up to one of the characters *ends*, and where they end."""
    parts: list[Any] = []
    plain = ""
    while position < len(text) and text[position] not in ends:
        if text[position] == "\\" and text[position + 1 : position + 2] in ("$", "'", '"', "\\"):
            plain, position = plain + text[position + 1], position + 2
        elif text.startswith("$(", position) and depth < DEEPEST_SUBSTITUTION:
            parts, plain = [*parts, plain] if plain else parts, ""
            made, position = _substitution(text, position + 2, depth + 1)
            parts.append(made)
        else:
            plain, position = plain + text[position], position + 1
    return [*parts, plain] if plain else parts, position


def _substitution(text: str, position: int, depth: int) -> tuple[Substitution, int]:
    words: list[list[Any]] = []
    while position < len(text) and text[position] != ")":
        if text[position].isspace():
            position += 1
        elif text[position] in "'\"":
            word, position = _parts(text, position + 1, text[position], depth)
            words.append(word)
            position += 1
        else:
            word, position = _parts(text, position, ") \t\n'\"", depth)
            words.append(word)
    name = words[0][0] if words and words[0] and isinstance(words[0][0], str) else ""
    return _substituted(name, words[1:]), position + 1


def _substituted(name: str, words: list[list[Any]]) -> Substitution:
    first = words[0] if words else [""]
    second = words[1] if len(words) > 1 else None
    makers: dict[str, Callable[[], Substitution]] = {
        "var": lambda: actions.argument(_plain(first), second),
        "arg": lambda: actions.argument(_plain(first), second),
        "find-pkg-share": lambda: actions.package_share(first),
        "find-pkg-prefix": lambda: actions.package_share(first),
        "env": lambda: actions.environment(first, second),
        "optenv": lambda: actions.environment(first, second or ""),
        "dirname": lambda: Substitution(lambda scope: str(scope.file.parent)),
        "filename": lambda: Substitution(lambda scope: str(scope.file)),
        "anon": lambda: actions.anonymous(first),
        "file-content": lambda: Substitution(lambda scope: file_text(Path(actions.text(first, scope)))),
        "eval": lambda: Substitution(lambda scope: _evaluated(words, scope)),
        "not": lambda: Substitution(lambda scope: str(not truth(actions.text(first, scope))).lower()),
        "and": lambda: _all(words, all),
        "or": lambda: _all(words, any),
        "any": lambda: _all(words, any),
        "all": lambda: _all(words, all),
        "equals": lambda: Substitution(
            lambda scope: str(actions.text(first, scope) == actions.text(second, scope)).lower()
        ),
        "if": lambda: Substitution(lambda scope: _chosen(words, scope)),
    }
    maker = makers.get(name)
    if maker is None:
        what = "no command is executed" if name == "command" else "it is not evaluated"
        return actions.unresolved(f"$({name} ...): {what}")
    return maker()


def _plain(word: list[Any]) -> Any:
    return word[0] if len(word) == 1 else word


def _evaluated(words: list[list[Any]], scope: LaunchScope) -> str:
    return str(evaluated(" ".join(actions.text(word, scope) for word in words), {}))


def _all(words: list[list[Any]], combine: Callable[[Any], bool]) -> Substitution:
    return Substitution(
        lambda scope: str(combine(truth(actions.text(word, scope)) for word in words)).lower()
    )


def _chosen(words: list[list[Any]], scope: LaunchScope) -> str:
    test, *values = words
    value = values[0 if truth(actions.text(test, scope)) else 1] if len(values) > 1 else values[0]
    return actions.text(value, scope)


# -- entities as actions


def actions_of(entity: Entity) -> list[Action]:
    """Return the actions of the children of a file, a group or a timer."""
    return [action for child in entity.children for action in _actions(child)]


def _actions(entity: Entity) -> Iterator[Action]:
    wanted = _condition(entity)
    made = list(_made(entity))
    for one in made:
        one.condition = actions.both(wanted, one.condition)
    yield from made


def _condition(entity: Entity) -> Substitution | None:
    wanted = actions.condition(entity.get("if")) if "if" in entity.attributes else None
    if "unless" in entity.attributes:
        return actions.both(wanted, actions.condition(entity.get("unless"), negated=True))
    return wanted


def _made(entity: Entity) -> Iterator[Action]:
    maker = _MAKERS.get(entity.kind)
    if maker is None:
        yield NotMapped(entity.where, f"<{entity.kind}> is left out")
        return
    if "output" in entity.attributes:
        yield NotMapped(entity.where, OUTPUT, lost=False)
    if "launch-prefix" in entity.attributes:
        yield NotMapped(entity.where, PREFIX)
    made = maker(entity)
    yield from made if isinstance(made, list) else [made]


def _node(entity: Entity) -> list[Action]:
    made: list[Action] = [
        NotMapped(child.where, f"<{child.kind}> of a node is left out")
        for child in entity.children
        if child.kind not in ("param", "remap", "composable_node")
    ]
    composable = [_composable(one) for one in entity.all("composable_node")]
    arguments = [one for name in ("args", "ros_args") if (one := entity.get(name)) is not None]
    if "ros_args" in entity.attributes:
        arguments.insert(-1, "--ros-args")
    node = LaunchNode(
        entity.where,
        entity.need("pkg"),
        entity.need("exec"),
        entity.get("name"),
        entity.get("namespace"),
        _parameters(entity),
        _remaps(entity),
        arguments,
        respawn=entity.get("respawn"),
        respawn_delay=entity.get("respawn_delay"),
        composable=composable,
        is_split=True,
    )
    return [*made, node]


def _composable(entity: Entity) -> LaunchNode:
    return LaunchNode(
        entity.where,
        entity.need("pkg"),
        None,
        entity.get("name"),
        entity.get("namespace"),
        _parameters(entity),
        _remaps(entity),
        plugin=entity.need("plugin"),
        condition=_condition(entity),
    )


def _remaps(entity: Entity) -> list[tuple[Any, Any]]:
    return [(one.need("from"), one.need("to")) for one in entity.all("remap")]


def _parameters(entity: Entity) -> list[Any]:
    made: list[Any] = []
    for one in entity.all("param"):
        if "from" in one.attributes:
            made.append(one.get("from"))
        else:
            made.append(_named_parameter(one))
    return made


def _named_parameter(entity: Entity) -> dict[str, Any]:
    nested = entity.all("param")
    name = entity.attributes.get("name", "")
    if nested:
        below: dict[str, Any] = {}
        for one in nested:
            below |= _named_parameter(one)
        return {f"{name}.{key}": value for key, value in below.items()}
    separator = entity.attributes.get("value-sep", entity.attributes.get("sep"))
    stated = entity.need("value")
    if separator is not None:
        return {name: Substitution(lambda scope: _listed(actions.text(stated, scope), separator))}
    kinds = {"str": str, "int": int, "float": float, "bool": bool}
    return {name: actions.Typed(stated, kinds.get(entity.attributes.get("type", "")))}


def _listed(text: str, separator: str) -> str:
    return "[" + ", ".join(text.split(separator)) + "]"


def _include(entity: Entity) -> Action:
    arguments = [(one.need("name"), one.need("value")) for one in entity.all("arg", "let")]
    return actions.Include(entity.where, entity.need("file"), arguments)


def _group(entity: Entity) -> Action:
    scoped = entity.attributes.get("scoped", "true").lower() not in ("false", "0")
    return actions.ActionGroup(entity.where, actions_of(entity), scoped)


def _ignored(what: str, *, lost: bool = True) -> Callable[[Entity], Action]:
    return lambda entity: NotMapped(entity.where, what, lost)


_MAKERS: Mapping[str, Callable[[Entity], Action | list[Action]]] = {
    "arg": lambda one: actions.Declare(one.where, one.need("name"), one.get("default")),
    "let": lambda one: actions.Let(one.where, one.need("name"), one.need("value")),
    "node": _node,
    "lifecycle_node": _node,
    "node_container": _node,
    "load_composable_node": lambda one: actions.LoadComposable(
        one.where, one.need("target"), [_composable(each) for each in one.all("composable_node")]
    ),
    "group": _group,
    "include": _include,
    "push_ros_namespace": lambda one: actions.PushNamespace(one.where, one.need("namespace")),
    "push_namespace": lambda one: actions.PushNamespace(one.where, one.need("namespace")),
    "set_remap": lambda one: actions.SetRemap(one.where, one.need("from"), one.need("to")),
    "set_parameter": lambda one: actions.SetParameter(
        one.where, one.need("name"), actions.Typed(one.need("value"))
    ),
    "set_parameters_from_file": lambda one: actions.SetParameterFile(one.where, one.need("filename")),
    "set_use_sim_time": lambda one: actions.SetParameter(
        one.where, "use_sim_time", actions.Typed(one.need("value"))
    ),
    "set_env": lambda one: actions.SetEnvironment(one.where, one.need("name"), one.need("value")),
    "unset_env": _ignored("<unset_env> is left out"),
    "timer": lambda one: [
        NotMapped(one.where, "<timer>: its nodes start with the others", lost=False),
        actions.ActionGroup(one.where, actions_of(one), scoped=False),
    ],
    "log": _ignored("<log> is left out", lost=False),
    "log_info": _ignored("<log_info> is left out", lost=False),
    "executable": _ignored("<executable> is left out: it is no node"),
}


def read_markup(entity: Entity, scope: LaunchScope) -> None:
    """Visit the actions of a file. Raises ``UnresolvedError`` if it is no launch file of ROS 2."""
    if entity.kind != "launch":
        raise UnresolvedError(f"its root is <{entity.kind}>, not <launch>")
    actions.visit_all(actions_of(entity), scope)
