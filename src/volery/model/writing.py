"""A model's tree as YAML text, as a person would write it: short mappings on one line, sections apart."""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from volery.model.text import Quoted

WIDTH = 110
_FLOW_WIDTH = 90


def model_text(tree: Mapping[str, Any]) -> str:
    """Return the text of a model or of one of its parts.

    Args:
        tree: Sections by their keys, as ``Node.plain`` returns them: a ``Quoted`` keeps its quotation marks.
    """
    parts: list[str] = []
    heads: list[str] = []
    for key, value in tree.items():
        text = _dumped({key: value}, WIDTH)
        if isinstance(value, Mapping | list) and value:
            parts.append(text)
        else:
            heads.append(text)
    return "\n".join(["".join(heads), *parts]) if heads else "\n".join(parts)


def flow_text(value: Any) -> str:
    """Return *value* as YAML on one line."""
    return _dumped(_flow(value), 10**9).removesuffix("\n").removesuffix("\n...")


def _dumped(value: Any, width: int) -> str:
    yaml = YAML()
    yaml.width = width
    out = StringIO()
    yaml.dump(value if isinstance(value, CommentedMap | CommentedSeq) else _block(value), out)
    return out.getvalue()


def _block(value: Any, depth: int = 0) -> Any:
    """Return *value* for ruamel: mappings and lists in flow style where they fit on a line."""
    if not isinstance(value, Mapping | list | tuple):
        return _scalar(value)
    if depth >= 2 and len(str(value)) <= _FLOW_WIDTH - 2 * depth:
        return _flow(value)
    if isinstance(value, Mapping):
        return CommentedMap({key: _block(below, depth + 1) for key, below in value.items()})
    return CommentedSeq([_block(below, depth + 1) for below in value])


def _flow(value: Any) -> Any:
    if isinstance(value, Mapping):
        made = CommentedMap({key: _flow(below) for key, below in value.items()})
        made.fa.set_flow_style()
        return made
    if isinstance(value, list | tuple):
        listed = CommentedSeq([_flow(below) for below in value])
        listed.fa.set_flow_style()
        return listed
    return _scalar(value)


def _scalar(value: Any) -> Any:
    return DoubleQuotedScalarString(value) if isinstance(value, Quoted) else value
