"""Message, service and action types: known definitions, new ones, and one class of each on demand.

A type's fields are those of the installed ROS 2 distribution, so that its bytes are those of the other nodes.

Interface files are parsed into the messages that they define, as ROS 2 names them. IDL spellings of field
types serve the comparison with rclpy's classes.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import Any, NamedTuple

from volery.base.errors import UsageError, choices, did_you_mean
from volery.ros.messages import lazy_rosbags as rosbags
from volery.ros.messages.message import (
    DEFAULTS,
    DurationValue,
    Header,
    MessageField,
    Nothing,
    RosMessage,
    TimeValue,
    make_class,
)

_ID = "unique_identifier_msgs/UUID goal_id\n"
_CONSTANT = re.compile(r"^([ \t]*\w+[ \t]+)([A-Za-z]\w*)(?=[ \t]*=)", re.MULTILINE)
_SEPARATOR = re.compile(r"^---.*\n?", re.MULTILINE)
"""A line between the parts of a service or an action; ROS 1 takes any that begins with three dashes."""
_CAPITALS = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*")


def interface_messages(name: str, text: str) -> dict[str, str]:
    """Return the texts of the messages that an interface file defines, by name.

    A service has ``Name_Request`` and ``Name_Response``. An action has what ROS 2 makes of it: ``Name_Goal``,
    ``Name_Result``, ``Name_Feedback``, the services ``Name_SendGoal`` and ``Name_GetResult``, and
    ``Name_FeedbackMessage``.
    """
    package, kind, label = [*name.split("/"), "", ""][:3]
    if not package or kind not in ("msg", "srv", "action") or not label or name.count("/") != 2:
        raise UsageError(
            f"{name!r} is no name of a type: package/msg/Name, package/srv/Name or package/action/Name"
        )
    if kind == "msg":
        return {name: text}
    if kind == "srv":
        request, response = _split(name, text, "a request and a response", 2)
        return {f"{name}_Request": request, f"{name}_Response": response}
    goal, result, feedback = _split(name, text, "a goal, a result and a feedback", 3)
    inner = f"{package}/msg/{label}"  # rosbags writes out no definition with an action's parts inside
    return {
        f"{inner}_Goal": goal,
        f"{inner}_Result": result,
        f"{inner}_Feedback": feedback,
        f"{name}_SendGoal_Request": f"{_ID}{package}/{label}_Goal goal",
        f"{name}_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp",
        f"{name}_GetResult_Request": _ID,
        f"{name}_GetResult_Response": f"int8 status\n{package}/{label}_Result result",
        f"{name}_FeedbackMessage": f"{_ID}{package}/{label}_Feedback feedback",
    }


def _split(name: str, text: str, what: str, count: int) -> list[str]:
    found = _SEPARATOR.split(text)
    if len(found) != count:
        lines = "one line '---'" if count == 2 else f"{count - 1} lines '---'"
        raise UsageError(f"{name}: {what}, with {lines} between them; here are {len(found)} parts")
    return found


_classes: dict[str, type[RosMessage]] = {}
_services: dict[str, ServiceType] = {}


class ServiceType(NamedTuple):
    """A service type's name (``package/srv/Name``) and the classes of its request and response."""

    name: str
    request: type[RosMessage]
    response: type[RosMessage]


ROS1_SPELLING = {"mavros_msgs": {"VFR_HUD": "VfrHud"}}
"""Types with another spelling in ROS 1: by package, ROS 1's name and ROS 2's."""
DISTRIBUTIONS = {3: "humble", 4: "iron", 7: "jazzy", 9: "kilted", 10: "lyrical"}
"""ROS 2 distributions by the major version of their rclpy; those between them were no releases."""
NOT_INSTALLED = "jazzy"
"""Distribution whose definitions are used where no ROS 2 is installed: the one that volery installs."""


@cache
def distribution() -> str:
    """Return the ROS 2 distribution whose definitions are used: that of the installed rclpy.

    Without one it is what ``ROS_DISTRO`` names, or else ``NOT_INSTALLED``.
    """
    try:
        major = int(version("rclpy").partition(".")[0])
    except (PackageNotFoundError, ValueError):
        named = os.environ.get("ROS_DISTRO", "")
        return named if named in DISTRIBUTIONS.values() else NOT_INSTALLED
    known = [one for one in DISTRIBUTIONS if one <= major]
    return DISTRIBUTIONS[max(known, default=min(DISTRIBUTIONS))]


@cache
def types_of_noetic() -> rosbags.Typestore:
    """Return the types of ROS 1 Noetic."""
    return rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC)


def types_of(named: str) -> rosbags.Typestore:
    """Return the types of a ROS 2 distribution, as rosbags knows them; ``ValueError`` if it does not."""
    return rosbags.get_typestore(rosbags.Stores(f"ros2_{named}"))


_SINCE_JAZZY = {("sensor_msgs/msg/NavSatStatus", "status"): -2}


@cache
def store() -> rosbags.Typestore:
    """Return the types of the distribution in use and of ``definitions/``. Private to this package."""
    known = types_of(distribution())
    if distribution() not in ("humble", "iron"):
        DEFAULTS.update(_SINCE_JAZZY)
    gone = {name: what for name, what in types_of("humble").fielddefs.items() if name not in known.fielddefs}
    if gone:
        known.register(gone)
    texts: dict[str, str] = {}
    written_out = files("volery.ros.messages").joinpath("definitions").iterdir()
    for file in sorted(written_out, key=lambda file: file.name):
        for name, text in read_definitions(file.name.removesuffix(".txt"), file.read_text("utf-8")).items():
            texts.update(interface_messages(name, text))
    _register(known, texts)
    return known


def read_definitions(package: str, text: str) -> dict[str, str]:
    """Return the definitions of a file of ``definitions/`` by full name."""
    found = {}
    for section in text.split("\n=== ")[1:]:
        heading, body = section.split("\n", 1)
        found[f"{package}/{heading.strip()}"] = body
    return found


def parse_messages(name: str, text: str) -> dict[str, Any]:
    """Return the constants and fields of the messages that a definition has, by name, as rosbags states them.

    rosbags takes names of constants in capitals only, as ROS 2 demands; ROS 1 takes any, and they are part of
    a type's checksum. Other names are replaced while the definition is parsed.

    Args:
        name: Name of the message.
        text: Its definition; others may follow it, as in a rosbag.

    Raises:
        TypesysError: The definition is none. The error is of rosbags.
    """
    names: dict[str, str] = {}

    def with_capitals(found: re.Match[str]) -> str:
        if _CAPITALS.fullmatch(found[2]):
            return found[0]
        substitute = f"SUBSTITUTE_{len(names)}"
        names[substitute] = found[2]
        return found[1] + substitute

    parsed = rosbags.get_types_from_msg(_CONSTANT.sub(with_capitals, text), name)
    return {
        full: ([(names.get(one, one), *rest) for one, *rest in constants], fields)
        for full, (constants, fields) in parsed.items()
    }


_SECTION = re.compile(r"^={80}\r?\n(MSG|IDL): (\S+)\r?\n", re.MULTILINE)


def parse_definition(name: str, text: str, *, idl: bool = False) -> dict[str, Any]:
    """Return the types that a recording's definition has, by name: of messages, IDL, or both.

    Args:
        name: Name of the message.
        text: Its definition; those of its parts may follow, each under a line ``MSG: name`` or ``IDL: name``.
        idl: Whether it begins with IDL.

    Raises:
        TypesysError: The definition is none. The error is of rosbags.
    """
    head, *rest = _SECTION.split(text)
    sections = [("IDL" if idl else "MSG", name, head), *zip(*[iter(rest)] * 3, strict=True)]
    parsed: dict[str, Any] = {}
    for kind, label, body in sections:
        if kind == "IDL" and body.strip():
            parsed.update(rosbags.get_types_from_idl(body))
        elif kind == "MSG" and (label == name or body.strip()):
            package, _, rest_of_name = label.partition("/")
            full = label if "/" in rest_of_name else f"{package}/msg/{rest_of_name}"
            parsed.setdefault(full, parse_messages(full, body)[full])
    return parsed


_ROS1_ENDINGS = ("ActionGoal", "ActionResult", "ActionFeedback", "Action", "Goal", "Result", "Feedback")


def define_ros1_action(package: str, name: str) -> bool:
    """Define the messages that ROS 1 makes of an action, if *name* is one of them; return whether it is.

    Of the action ``Dock`` these are ``DockGoal``, ``DockResult`` and ``DockFeedback``, the three of them with
    header and status, ``DockActionGoal`` and so on, and ``DockAction``, which has all.
    """
    known = store().fielddefs
    full = f"{package}/msg/{name}"
    labels = (name.removesuffix(ending) for ending in _ROS1_ENDINGS if name.endswith(ending))
    label = next((label for label in labels if f"{package}/action/{label}_FeedbackMessage" in known), None)
    if label is None or full in known:
        return label is not None
    inner = f"{package}/msg/{label}"
    parts = ("Goal", "Result", "Feedback")
    store().register(
        {f"{inner}{part}": known[f"{inner}_{part}"] for part in parts if f"{inner}{part}" not in known}
    )
    texts: dict[str, str] = {}
    for part in parts:
        of = "GoalID goal_id" if part == "Goal" else "GoalStatus status"
        own = f"{package}/{label}{part} {part.lower()}"
        texts[f"{inner}Action{part}"] = f"std_msgs/Header header\nactionlib_msgs/{of}\n{own}"
    whole = (f"{package}/{label}Action{part} action_{part.lower()}" for part in parts)
    _register(store(), {**texts, f"{inner}Action": "\n".join(whole)})
    return True


_STATED = re.compile(r"^[ \t]*[\w/]+(?:<=\d+)?(?:\[[^]]*\])?[ \t]+([a-z]\w*)[ \t]+([^\s=#].*)$", re.MULTILINE)
_LITERAL = re.compile(r"""\[[^]]*\]|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|[^\s#]+""")


def stated_defaults(text: str) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a definition of ROS 2 that state a default, with its value."""
    for label, rest in _STATED.findall(text):
        match = _LITERAL.match(rest)
        literal = re.sub(r"\b(true|false)\b", lambda word: word[0].title(), match[0] if match else "")
        with suppress(ValueError, SyntaxError):  # what is no value is a comment's or a string without quotes
            yield label, ast.literal_eval(literal)


def _register(into: rosbags.Typestore, texts: dict[str, str]) -> None:
    parsed = {}
    for name, text in texts.items():
        try:
            # a service's halves read as messages, so that unqualified types are looked for among them
            read_as = name.replace("/srv/", "/msg/").replace("/action/", "/msg/")
            [parsed[name]] = parse_messages(read_as, text).values()
            DEFAULTS.update({(name, label): value for label, value in stated_defaults(text)})
        except rosbags.TypesysError as error:
            raise UsageError(f"{name}: not a ROS message definition: {error}") from error
    for name, (_, fields) in parsed.items():
        for label, what in fields:
            inner = _inner_type(what)
            if inner.rpartition("/")[2] == "wstring":
                raise UsageError(
                    f"{name}.{label}: wstring is not supported; string carries any text as UTF-8"
                )
            if inner and inner not in parsed and inner not in into.fielddefs:
                raise UsageError(f"{name}.{label}: no message type named {inner!r}; define it first")
    try:
        into.register(parsed)
    except rosbags.TypesysError as error:
        raise UsageError(str(error)) from error
    except SyntaxError as error:  # classes are made of source code
        raise UsageError(f"{', '.join(parsed)}: not a name of a type or a field: {error}") from error


def _inner_type(what: Any) -> str:
    """Return the message type of a field or of its elements; empty for numbers and strings."""
    kind, detail = what
    if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
        return _inner_type(detail[0])
    return str(detail) if kind == rosbags.Nodetype.NAME else ""


def define(name: str, text: str) -> None:
    """Define a type from the text of its ``.msg``, ``.srv`` or ``.action`` file.

    Args:
        name: ``package/msg/Name``, ``package/srv/Name`` or ``package/action/Name``.
        text: The definition.

    Raises:
        UsageError: the text is no definition, or the name has another one.
    """
    define_all({name: text})


def define_all(texts: Mapping[str, str]) -> None:
    """Define several types, which may contain each other; see ``define``."""
    found: dict[str, str] = {}
    for name, text in texts.items():
        found.update(interface_messages(name, text))
    _register(store(), found)


_STATEMENT = re.compile(r"^[ \t]*([\w/]+(?:<=\d+)?)(\[[^]\n]*\])?[ \t]+(\w+)", re.MULTILINE)
_KEPT = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration", "std_msgs/msg/Header")
"""Types whose definitions stay: their classes have arithmetic, or differ between ROS 1 and 2."""
_OF_VEHICLES = (
    *("geographic_msgs", "geometry_msgs", "mavros_msgs", "nav_msgs", "sensor_msgs", "std_msgs"),
    *("dji_osdk_ros", "dji_sdk", "pprzros_msgs", "roscopter"),
)
"""Packages whose messages the nodes of vehicles publish: another definition must have the fields of these."""


def replace_known(name: str, text: str) -> bool:
    """Forget the known definition of a type if *text* states another, which can be defined then.

    A definition stays if the text is that of ROS 1 Noetic, if messages of the type exist, or if the nodes of
    vehicles fill fields that the other one lacks.

    Returns:
        Whether the known definition was forgotten.
    """
    if is_known_as(name, text):
        return False
    known = store().fielddefs
    stated = interface_messages(name, text)
    if any(full in _KEPT or full in _classes for full in stated):
        return False
    for full, one in stated.items():
        read_as = full.replace("/srv/", "/msg/").replace("/action/", "/msg/")
        try:
            [(constants, fields)] = parse_messages(read_as, one).values()
        except rosbags.TypesysError:
            return True  # defining it says what is wrong
        ours = [field for field in known[full][1] if field[0] != FILLER]
        noetic = types_of_noetic().fielddefs.get(full)
        if noetic is not None and list(noetic[1]) == fields:
            continue
        lacking = {label for label, _ in ours} - {label for label, _ in fields}
        if lacking and full.partition("/")[0] in _OF_VEHICLES:
            return False
        if fields != ours or sorted(map(str, constants)) != sorted(map(str, known[full][0])):
            for part in stated:
                known.pop(part, None)
                store().types.pop(part, None)
            return True
    return False


def is_known_as(name: str, text: str) -> bool:
    """Return whether the known definition of a type states the fields and constants of *text*."""
    stated = interface_messages(name, text)
    return all(_outline(full, one) == _known_outline(full) for full, one in stated.items())


def has_messages(name: str) -> bool:
    """Return whether messages of a type may exist, so that its definition must stay."""
    return any(full in _classes for full in (name, f"{name}_Request", f"{name}_Response"))


def _outline(full: str, text: str) -> set[str]:
    """Return types and names that a definition states, spelled as in ROS 2."""
    package = full.partition("/")[0]
    found = set()
    for kind, bounds, label in _STATEMENT.findall(text):
        array = bounds.replace("<=", "")
        of, _, last = kind.rpartition("/")
        if not of and kind[0].isupper():
            of = "std_msgs" if kind == "Header" else package
        found.add(f"{of.removesuffix('/msg')}/{last}{array} {label}" if of else f"{kind}{array} {label}")
    return found


def _known_outline(full: str) -> set[str]:
    constants, fields = store().fielddefs[full]
    found = {f"{kind} {label}" for label, kind, _ in constants}
    return found | {f"{_stated(what)} {label}" for label, what in fields if label != FILLER}


def _stated(what: Any) -> str:
    kind, detail = what
    if kind == rosbags.Nodetype.NAME:
        return str(detail).replace("/msg/", "/")
    if kind == rosbags.Nodetype.BASE:
        return f"{detail[0]}<={detail[1]}" if detail[1] else str(detail[0])
    return f"{_stated(detail[0])}[{detail[1] or ''}]"


def types() -> list[str]:
    """Return the names of all message types, sorted."""
    return sorted(name for name in list(store().fielddefs) if name.split("/")[1] == "msg")


def type_hash(name: str) -> bytes:
    """Return the 32 bytes of a type's RIHS01 hash, by which ROS 2 compares definitions."""
    return bytes.fromhex(store().hash_rihs01(name).rpartition("_")[2])


def service_types() -> list[str]:
    """Return the names of all service types without those of actions, sorted."""
    ending = "_Request"
    names = (name for name in list(store().fielddefs) if name.endswith(ending) and "/srv/" in name)
    return sorted(name.removesuffix(ending) for name in names)


def action_types() -> list[str]:
    """Return the names of all action types, sorted."""
    ending = "_FeedbackMessage"
    return sorted(name.removesuffix(ending) for name in list(store().fielddefs) if name.endswith(ending))


def _full(name: str, kind: str) -> str:
    package, _, rest = name.partition("/")
    return name if "/" in rest else f"{package}/{kind}/{rest}"


def _unknown(what: str, name: str, known: list[str]) -> UsageError:
    package = name.partition("/")[0]
    alike = [one for one in known if one.startswith(f"{package}/")]
    hint = did_you_mean(name, known)
    there = f"; {package} has {choices(one.split('/')[-1] for one in alike)}" if alike else ""
    return UsageError(f"no {what} type named {name!r}{hint}{there}")


def message_name(name: str) -> str:
    """Return a message type's full name: ``std_msgs/msg/String`` for ``std_msgs/String``.

    Raises ``UsageError`` if it is unknown.
    """
    if name in store().fielddefs:
        return name
    full = _full(name, "msg")
    package, _, label = full.rpartition("/msg/")
    if full not in store().fielddefs and not define_ros1_action(package, label):
        raise _unknown("message", full, types())
    return full


def service_name(name: str) -> str:
    """Return a service type's full name: ``std_srvs/srv/Trigger`` for ``std_srvs/Trigger``.

    Raises ``UsageError`` if it is unknown.
    """
    full = _full(name, "srv")
    if f"{full}_Request" not in store().fielddefs:
        raise _unknown("service", full, service_types())
    return full


def message_class(name: str) -> type[RosMessage]:
    """Return the class of a message type, created on demand; raise ``UsageError`` if the type is unknown."""
    known = _classes.get(name)
    if known:
        return known
    full = message_name(name)
    if full not in _classes:
        constants, fields = store().fielddefs[full]
        described = [
            _describe(rosbags.normalize_fieldname(key), what) for key, what in fields if key != FILLER
        ]
        named = [(rosbags.normalize_fieldname(label), kind, value) for label, kind, value in constants]
        made = make_class(full, _BASES.get(full, RosMessage if described else Nothing), named, described)
        _classes[full] = made
        store().types[full] = made  # what bytes are decoded to
        if issubclass(made, (TimeValue, DurationValue)):
            _introduce(made)
    _classes[name] = _classes[full]
    return _classes[full]


_TIME, _DURATION = "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"
_BASES: dict[str, type[RosMessage]] = {
    _TIME: TimeValue,
    _DURATION: DurationValue,
    "std_msgs/msg/Header": Header,
}
FILLER = "structure_needs_at_least_one_member"
"""Field that an empty message has in ROS 2."""


def _introduce(made: Any) -> None:
    """Set the result classes of time arithmetic: the difference of two times is a duration."""
    if issubclass(made, TimeValue):
        TimeValue.kind = made
        message_class(_DURATION)
    else:
        DurationValue.kind = made
        message_class(_TIME)


def _describe(name: str, what: Any) -> MessageField:
    kind, detail = what
    if kind == rosbags.Nodetype.BASE:
        return MessageField(name, detail[0], None, None)
    if kind == rosbags.Nodetype.NAME:
        return MessageField(name, "", message_class(detail), None)
    (inner_kind, inner), count = detail
    bound = 0
    if kind == rosbags.Nodetype.SEQUENCE:
        count, bound = 0, count or 0
    if inner_kind == rosbags.Nodetype.BASE:
        return MessageField(name, inner[0], None, count, bound)
    return MessageField(name, "", message_class(inner), count, bound)


def service(name: str) -> ServiceType:
    """Return a service type with its request and response classes."""
    known = _services.get(name)
    if known:
        return known
    full = service_name(name)
    made = ServiceType(full, message_class(f"{full}_Request"), message_class(f"{full}_Response"))
    _services[name] = made
    return made


def new(name: str, /, **fields: Any) -> Any:
    """Return a new message of type `name`; other fields have defaults, a nested one may be a ``dict``.

    Raises ``UsageError`` for an unknown type or field.
    """
    cls = _classes.get(name) or message_class(name)
    for key, value in fields.items():
        if value.__class__ is dict:
            fields[key] = _nested(cls, key, value)
    try:
        return cls(**fields)
    except TypeError:
        wrong = next(key for key in fields if key not in cls.__match_args__)
        hint = did_you_mean(wrong, cls.__match_args__)
        raise UsageError(
            f"{cls.__msgtype__} has no field {wrong!r}{hint}; it has {choices(cls.__match_args__)}"
        ) from None


def _nested(cls: type[RosMessage], key: str, value: dict[str, Any]) -> Any:
    for label, what in store().fielddefs[cls.__msgtype__][1]:
        if rosbags.normalize_fieldname(label) == key and what[0] == rosbags.Nodetype.NAME:
            return new(str(what[1]), **value)
    return value


def request(name: str, /, **fields: Any) -> Any:
    """Return a new request of service type `name`; see ``new``."""
    return new(f"{service_name(name)}_Request", **fields)


def definition(name: str) -> str:
    """Return a type's definition in ``.msg`` format with its nested types (MCAP's ``ros2msg``)."""
    return store().generate_msgdef(message_name(name), ros_version=2)[0]


SPELLED = {"float32": "float", "float64": "double", "bool": "boolean", "byte": "octet", "char": "uint8"}
"""Names of basic types in IDL, where they differ."""


@cache
def idl_fields(name: str) -> dict[str, str]:
    """Return the IDL types of a message's fields by name: ``{"data": "sequence<double>"}``."""
    fields = store().fielddefs[message_name(name)][1]
    return {label: _spell(what) for label, what in fields if label != "structure_needs_at_least_one_member"}


@cache
def nested_types(name: str) -> tuple[str, ...]:
    """Return the message types that are fields, or elements of fields, of type `name`."""
    inner = (_inner(what) for _, what in store().fielddefs[message_name(name)][1])
    return tuple(sorted({one for one in inner if one}))


def _inner(what: Any) -> str:
    kind, detail = what
    if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
        return _inner(detail[0])
    return str(detail) if kind == rosbags.Nodetype.NAME else ""


def _spell(what: Any) -> str:
    kind, detail = what
    if kind == rosbags.Nodetype.NAME:
        return str(detail).replace("/msg/", "/")
    if kind == rosbags.Nodetype.BASE:
        base, bound = detail
        return f"{base}<{bound}>" if bound else SPELLED.get(base, base)
    inner, count = detail
    if kind == rosbags.Nodetype.ARRAY:
        return f"{_spell(inner)}[{count}]"
    return f"sequence<{_spell(inner)}{f', {count}' if count else ''}>"
