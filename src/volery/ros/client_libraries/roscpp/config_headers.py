"""Headers of dynamic_reconfigure: ``package/NameConfig.h`` from ``cfg/*.cfg``, which are not executed."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import Location, ModelError, choices
from volery.ros.messages.workspace import Workspace

_KINDS = {
    "double_t": ("double", "double"),
    "int_t": ("int", "int"),
    "bool_t": ("bool", "bool"),
    "str_t": ("str", "std::string"),
}
"""Type of a parameter by its name in a ``.cfg`` file: in descriptions, and in C++."""
_INFINITY = "std::numeric_limits<double>::infinity()"
_LIMITS = {
    "double": (f"-{_INFINITY}", _INFINITY),
    "int": ("std::numeric_limits<int>::min()", "std::numeric_limits<int>::max()"),
    "bool": ("false", "true"),
    "str": ('""', '""'),
}


class _Parameter(NamedTuple):
    """A parameter; values are written as in C++."""

    name: str
    kind: str
    cpp: str
    level: int
    description: str
    default: str
    least: str
    greatest: str


def config_header(package: str, name: str, file: Path) -> str | None:
    """Return the text of ``package/nameConfig.h`` as *file* includes it, or None if no ``.cfg`` makes it.

    Raises:
        ModelError: A parameter of it is computed; the error has file and line.
    """
    found = Workspace().find(package, file)
    for one in sorted((found.folder / "cfg").glob("*.cfg")) if found is not None else ():
        tree = ast.parse(one.read_text(encoding="utf-8", errors="replace"), str(one))
        if any(name == made for made in _generated(tree)):
            return _header(package, name, list(_parameters(tree, one)))
    return None


def _calls(tree: ast.Module, method: str) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == method:
            yield node


def _generated(tree: ast.Module) -> Iterator[Any]:
    """Yield the names of the classes that a file makes."""
    for call in _calls(tree, "generate"):
        yield getattr(call.args[2], "value", None) if len(call.args) > 2 else None


def _parameters(tree: ast.Module, file: Path) -> Iterator[_Parameter]:
    names = ("name", "paramtype", "level", "description", "default", "min", "max", "edit_method")
    constants = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    calls = sorted(_calls(tree, "add"), key=lambda call: call.lineno)
    for call in calls:
        given = dict(zip(names, call.args, strict=False)) | {
            keyword.arg: keyword.value for keyword in call.keywords
        }
        values = {}
        for name, node in given.items():
            if name == "edit_method" or name is None:
                continue
            if name == "paramtype":
                values[name] = getattr(node, "id", getattr(node, "attr", ""))
                continue
            try:
                values[name] = _value(constants.get(getattr(node, "id", ""), node))
            except ValueError:
                what = f"{name} of the parameter is computed; write its value, for the file is not executed"
                raise ModelError(what, where=Location(str(file), call.lineno)) from None
        kind, cpp = _KINDS.get(values.get("paramtype", ""), ("", ""))
        if not kind:
            what = f"a parameter is of {choices(_KINDS)}"
            raise ModelError(what, where=Location(str(file), call.lineno))
        least, greatest = _LIMITS[kind]
        yield _Parameter(
            values["name"],
            kind,
            cpp,
            int(values.get("level", 0)),
            str(values.get("description", "")),
            _cpp(values.get("default"), kind, "{}"),
            _cpp(values.get("min"), kind, least),
            _cpp(values.get("max"), kind, greatest),
        )


def _value(node: ast.expr) -> Any:
    """Return the value of a constant, or of numbers; raise ``ValueError`` for any other expression."""
    if isinstance(node, ast.BinOp):
        left, right = _value(node.left), _value(node.right)
        operations: dict[type, Any] = {
            ast.Add: lambda: left + right,
            ast.Sub: lambda: left - right,
            ast.Mult: lambda: left * right,
            ast.Div: lambda: left / right,
        }
        if type(node.op) not in operations or not all(type(one) in (int, float) for one in (left, right)):
            raise ValueError
        return operations[type(node.op)]()
    return ast.literal_eval(node)


def _cpp(value: Any, kind: str, otherwise: str) -> str:
    if value is None:
        return otherwise
    if kind == "str":
        return '"' + re.sub(r'([\\"])', r"\\\1", str(value)) + '"'
    if kind == "bool":
        return "true" if value else "false"
    return repr(float(value)) if kind == "double" else str(int(value))


def _header(package: str, name: str, parameters: list[_Parameter]) -> str:
    members = "\n".join(
        f"    {parameter.cpp} {parameter.name} = {parameter.default};" for parameter in parameters
    )
    visits = "\n".join(_visit(f"&{name}Config::{parameter.name}", parameter) for parameter in parameters)
    return _TEXT.format(package=package, name=name, members=members, visits=visits)


def _visit(member: str, one: _Parameter) -> str:
    described = f'"{one.name}", "{one.kind}", {one.level}, {_cpp(one.description, "str", "")}'
    limits = f"{one.cpp}({one.least}), {one.cpp}({one.greatest})"
    return f"        visit(Parameter{{{described}}}, {member}, {limits});"


_TEXT = """\
// Generated from the cfg file of {package}.
#pragma once
#include "dynamic_reconfigure/config_tools.h"

namespace {package} {{

class {name}Config : public dynamic_reconfigure::ConfigBase<{name}Config> {{
public:
{members}

    template <class Visitor>
    static void each_([[maybe_unused]] Visitor&& visit) {{
        using dynamic_reconfigure::Parameter;
{visits}
    }}
}};

}}  // namespace {package}
"""
