"""The notations inside the text of a UML model: S3D's comments and times, and MARTE's VSL.

Their writers are people, so the readers are tolerant: blanks, case, a missing semicolon, ``null`` and empty
texts are accepted. What is no figure (an expression with a variable) is returned as None, for a note.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

_PROPERTY = re.compile(r"\$\s*(\w+)\s*=\s*([^;]*?)\s*(?:;|$)")
_TAG = re.compile(r"([A-Za-z_][\w/]*)\s*=\s*([^;,()]*)")
_PATTERN = re.compile(r"\s*([A-Za-z]+)\s*(?:[(=]|$)")
_FIGURE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-zµ%_/]*)\s*\Z")
_PAIR = re.compile(r"\(\s*([-+.\deE]+)\s*,\s*([A-Za-z_/%]+)\s*\)\s*\Z")

UNITS: Mapping[str, str] = {
    "KHz": "kHz",
    "KJ": "kJ",
    "KW": "kW",
    "KWh": "kWh",
    "hrs": "h",
    "day": "d",
    "Byte": "B",
    "KB": "kB",
    "b_per_s": "bit/s",
    "Kb_per_s": "kbit/s",
    "Mb_per_s": "Mbit/s",
}
"""Units of MARTE's library whose symbol differs from volery's."""

_MARTE_UNITS = {ours: theirs for theirs, ours in UNITS.items()}

SOURCES: Mapping[str, str] = {
    "est": "estimated",
    "meas": "measured",
    "calc": "calculated",
    "req": "required",
}
"""MARTE's ``SourceKind``, and the provenance of volery."""

ABSENT = ("", "null", "undef", "-")


def properties(body: str) -> dict[str, str]:
    """Return the properties of a comment: ``$language=C++;`` gives ``{"language": "C++"}``."""
    return {name: value.strip().strip("\"'") for name, value in _PROPERTY.findall(body)}


def property_text(name: str, value: str) -> str:
    """Return the body of the comment that states a property."""
    return f"${name}={value};"


@dataclass(frozen=True)
class Tagged:
    """Values by their tags in lower case, and what applies to all of them.

    ``pattern`` is the word before the parentheses of an occurrence: ``periodic``.
    """

    values: Mapping[str, str] = field(default_factory=dict)
    unit: str = ""
    source: str = ""
    pattern: str = ""

    def quantity(self, *tags: str) -> str | None:
        """Return the value of the first of *tags* that has a figure, with its unit: ``200 ms``."""
        for tag in tags:
            found = figure(self.values.get(tag, ""), self.unit)
            if found is not None:
                return found
        return None


def tagged(text: str) -> Tagged:
    """Return what a text such as ``BCET = 1; WCET = 15; unit = ms`` states.

    ``BOET/MOET/WOET = 1/8/15`` gives three values. VSL is read too: ``(value=5,unit=ms,source=est)`` and
    ``periodic(period=(200,ms), jitter=(1,ms))``.
    """
    pairs = re.sub(r"=\s*\(\s*([-+.\deE]+)\s*,\s*([A-Za-z_/%]+)\s*\)", r"= \1 \2", text)
    pattern = _PATTERN.match(pairs)
    word = pattern.group(1).lower() if pattern and "=" not in pairs[: pattern.end()] else ""
    values: dict[str, str] = {}
    for name, value in _TAG.findall(pairs):
        names, parts = name.lower().split("/"), value.strip().split("/")
        if len(names) == len(parts):
            values.update(zip(names, (part.strip() for part in parts), strict=True))
        else:
            values[name.lower()] = value.strip()
    return Tagged(values, values.pop("unit", ""), values.pop("source", ""), word)


def figure(text: str, unit: str = "") -> str | None:
    """Return a figure with its unit in volery's symbols, None where *text* states none.

    ``200`` with unit ``ms``, ``200 ms``, ``(200,ms)``, ``(value=200,unit=ms)`` all give ``200 ms``.
    """
    text = text.strip()
    if text.lower() in ABSENT:
        return None
    pair = _PAIR.match(text)
    if pair:
        text = f"{pair.group(1)} {pair.group(2)}"
    plain = _FIGURE.match(text)
    if plain:
        symbol = plain.group(2) or unit
        return f"{plain.group(1)} {UNITS.get(symbol, symbol)}".strip()
    if "=" in text:
        found = tagged(text)
        return found.quantity("value", "expr", "mean", "worst", "max")
    return None


def stated_quantity(text: str) -> str | dict[str, str] | None:
    """Return a figure as a model states it: with its provenance if *text* has a VSL ``source``."""
    found = figure(text)
    provenance = SOURCES.get(tagged(text).source) if found is not None and "=" in text else None
    return {"value": found, "provenance": provenance} if found and provenance else found


def quantity_text(value: object) -> tuple[str, dict[str, object]]:
    """Return a quantity of a model as MARTE writes it, and what it has no place for.

    A quantity with a provenance becomes VSL: ``(value=1500,unit=MHz,source=req)``.
    """
    rest = dict(value) if isinstance(value, Mapping) else {}
    text = str(rest.pop("value", "") if isinstance(value, Mapping) else value)
    try:
        number, unit = split_figure(text)
    except ValueError:
        return text, rest
    source = next((one for one, name in SOURCES.items() if name == rest.get("provenance")), "")
    if source:
        rest.pop("provenance")
        return f"(value={number},unit={unit},source={source})", rest
    return f"{number} {unit}".strip(), rest


def split_figure(text: str) -> tuple[str, str]:
    """Return the number and MARTE's unit of a quantity such as ``0.3 ms``.

    Raises:
        ValueError: *text* is no number with a unit.
    """
    plain = _FIGURE.match(text)
    if plain is None:
        raise ValueError(f"{text!r} is no number with a unit")
    return plain.group(1), _MARTE_UNITS.get(plain.group(2), plain.group(2))


def tagged_text(values: Mapping[str, str]) -> str:
    """Return quantities as S3D writes them: ``BOET/MOET/WOET = 1/8/15; unit = ms``.

    Raises:
        ValueError: a value is no number with a unit, or the units differ.
    """
    split = {tag: split_figure(value) for tag, value in values.items()}
    units = {unit for _, unit in split.values()}
    if len(units) != 1:
        raise ValueError(f"one unit is needed for all, not {' and '.join(sorted(units))}")
    figures = "/".join(number for number, _ in split.values())
    return f"{'/'.join(split)} = {figures}; unit = {units.pop()}"
