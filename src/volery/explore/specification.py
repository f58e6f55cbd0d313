"""What a campaign runs: the keys of ``explore`` in a model, or in a file beside it, as checked data.

The section is read from the text of the model and not with it, so that it may be in a file of its own, and so
that a campaign's folder keeps it in the same form.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np

from volery.base import units
from volery.base.errors import Location, ModelError, UsageError, choices, did_you_mean
from volery.base.files import read_text
from volery.base.time import Ns, S
from volery.base.units import QuantityError
from volery.explore.points import VariantPoint
from volery.explore.space import (
    GRID,
    LAWS,
    METHODS,
    Choices,
    DistributedParameter,
    Parameter,
    Range,
    SamplingPlan,
)
from volery.model.assembly import change_from_option, model_file, read_tree
from volery.model.builder import ModelBuilder, plain_node
from volery.model.fields import (
    DATA_SIZE,
    PERIOD,
    MapOf,
    OneOf,
    Record,
    Schema,
    Syntax,
    Whole,
    WrongValueError,
    read_child,
)
from volery.model.reading import ModelReading, Vocabulary
from volery.model.text import Path, Problems, TextNode, parse, parse_value

SECTION: Path = ("explore",)
EXPLORE_FILE = "explore.yaml"
"""File beside a model that may hold the section."""

FIDELITIES = ("times", "code")


class _Parameter(Syntax):
    """A list of values, a range ``a .. b`` or ``{from, to}``, a distribution, or a single value."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Parameter:
        """See ``Syntax``."""
        try:
            return read_parameter(node)
        except _WrongPartError as error:
            reading.problems.add((*path, *error.path), str(error))
            raise WrongValueError("") from None
        except UsageError as error:
            raise WrongValueError(str(error)) from None

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"x-quantity": f"a list of values, `a .. b`, {{from, to, steps, log}} or {_DISTRIBUTIONS}"}


_DISTRIBUTIONS = f"a distribution ({', '.join(LAWS)}, discrete)"


class _WrongPartError(UsageError):
    """Something below a parameter is wrong, at *path*."""

    def __init__(self, path: Path, message: str) -> None:
        super().__init__(message)
        self.path = path


def read_parameter(node: TextNode) -> Parameter:
    """Return the parameter that is written at *node*. Raises ``UsageError``."""
    if isinstance(node.value, list):
        if not node.value:
            raise UsageError("at least one value is needed")
        return Choices([one.plain() for one in node.value])
    if isinstance(node.value, dict):
        return _written_parameter(node)
    if isinstance(node.value, str) and not node.quoted and " .. " in node.value:
        low, _, high = node.value.partition(" .. ")
        return _range(low, high)
    return Choices([node.plain()])


_RANGE_KEYS = ("from", "to", "steps", "log", "integer")


def _written_parameter(node: TextNode) -> Parameter:
    stated: dict[str, Any] = {key: one.value for key, one in node.items.items()}
    if len(stated) == 1 and "from" not in stated and "to" not in stated:
        ((kind, inner),) = node.items.items()
        return _discrete(inner) if kind == "discrete" else _distribution(kind, inner)
    wrong = [key for key in stated if key not in _RANGE_KEYS]
    missing = [key for key in ("from", "to") if key not in stated]
    if wrong or missing:
        what = f"unknown key {wrong[0]!r}" if wrong else f"the key {missing[0]!r} is missing"
        raise _WrongPartError(
            (*wrong[:1],),
            f"{what}: a parameter is a list of values, `a .. b`, {{from, to, steps, log, integer}} or "
            f"{_DISTRIBUTIONS}",
        )
    for key, type_ in (("steps", int), ("log", bool), ("integer", bool)):
        if not isinstance(stated.get(key, type_()), type_):
            raise _WrongPartError((key,), f"`{key}` is {stated[key]!r}")
    return _range(
        stated["from"],
        stated["to"],
        steps=stated.get("steps", 0),
        log=stated.get("log", False),
        integer=stated.get("integer", False),
    )


def _distribution(name: str, node: TextNode) -> DistributedParameter:
    law = LAWS.get(name)
    if law is None:
        names = (*LAWS, "discrete")
        raise _WrongPartError(
            (name,), f"no distribution {name!r}{did_you_mean(name, names)}; there is {choices(names)}"
        )
    stated = {key: one.value for key, one in node.items.items()}
    if not stated:
        raise _WrongPartError((name,), f"a {name} distribution needs {', '.join(law.needed)}")
    try:
        bare = {key: _number(value) for key, value in stated.items() if key in law.bare}
        numbers, unit = _numbers({key: value for key, value in stated.items() if key not in law.bare})
        for key, (_, found) in bare.items():
            if found:
                raise _WrongPartError(
                    (name, key), f"`{key}` of a {name} distribution has no unit, not {found!r}"
                )
        return DistributedParameter(name, numbers | {key: number for key, (number, _) in bare.items()}, unit)
    except _WrongPartError:
        raise
    except UsageError as error:
        named = [key for key in stated if f"{key!r}" in str(error) or f"`{key}`" in str(error)]
        raise _WrongPartError((name, *named[:1]), str(error)) from None


def _discrete(node: TextNode) -> Choices:
    lists = {key: one.value for key, one in node.items.items()}
    wrong = [key for key in lists if key not in ("values", "weights")]
    if wrong or not all(isinstance(lists.get(key), list) and lists[key] for key in ("values", "weights")):
        raise _WrongPartError(
            ("discrete", *wrong[:1]), "a discrete distribution is {values: [600 MHz, 1 GHz], weights: [3, 1]}"
        )
    weights = []
    for place, one in enumerate(node.items["weights"].plain()):
        number, unit = _number(one)
        if unit:
            raise _WrongPartError(("discrete", "weights", place), f"a weight has no unit: {one!r}")
        weights.append(number)
    try:
        return Choices(list(node.items["values"].plain()), weights)
    except UsageError as error:
        raise _WrongPartError(("discrete", "weights"), str(error)) from None


def _numbers(stated: Mapping[str, Any]) -> tuple[dict[str, float], str]:
    """Return numbers with the same unit, and the unit."""
    found = {key: _number(value) for key, value in stated.items()}
    used = list(dict.fromkeys(unit for _, unit in found.values())) or [""]
    if len(used) > 1:
        raise UsageError(f"the numbers have the units {' and '.join(map(repr, used))}; use one for all")
    return {key: number for key, (number, _) in found.items()}, used[0]


def _number(value: Any) -> tuple[float, str]:
    """Return a number and its unit as written."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise UsageError(f"{value!r} is no number")
    if not isinstance(value, str):
        return value, ""
    text = value.strip()
    digits = text.partition(" ")[0]
    try:
        number = float(digits) if not digits.lstrip("+-").isdigit() else int(digits)
        units.parse(text)
    except (ValueError, QuantityError) as error:
        raise UsageError(f"{value!r} is no number with a unit, such as 600 MHz: {error}") from None
    return number, text[len(digits) :].strip()


def _range(low: Any, high: Any, *, steps: int = 0, log: bool = False, integer: bool = False) -> Range:
    numbers, unit = _numbers({"from": low, "to": high})
    if not numbers["from"] < numbers["to"]:
        raise UsageError(f"a range goes up: {low} is not less than {high}")
    if log and numbers["from"] <= 0.0:
        raise UsageError(f"a logarithmic range begins above 0, not at {low}")
    return Range(numbers["from"], numbers["to"], unit, log, integer, steps)


def parameter_text(parameter: Parameter) -> Any:
    """Return a parameter as it is written in YAML, as plain data."""
    if isinstance(parameter, Choices):
        values = list(parameter.values)
        return (
            {"discrete": {"values": values, "weights": list(parameter.weights)}}
            if parameter.weights
            else values
        )
    if isinstance(parameter, DistributedParameter):
        bare = LAWS[parameter.law].bare
        return {
            parameter.law: {
                key: number if key in bare or not parameter.unit else f"{number!r} {parameter.unit}"
                for key, number in parameter.numbers.items()
                if np.isfinite(number)
            }
        }
    ends = Range(parameter.low, parameter.high, parameter.unit)
    flags = {"steps": parameter.steps, "log": parameter.log, "integer": parameter.integer}
    return {"from": ends.value(ends.low), "to": ends.value(ends.high)} | {
        key: flag for key, flag in flags.items() if flag
    }


@dataclass(frozen=True, slots=True)
class Specification:
    """What a campaign runs.

    Attributes:
        space: The parameters that are varied.
        plan: How the space is sampled.
        points: Number of points of the plan; a grid has its own.
        seeds: Number of runs of each variant.
        seed: Seed of the campaign: of its plan and of the seeds of its runs.
        common: Whether all variants have the same seeds (common random numbers), so that their differences
            are due to the variants. Otherwise each run has its own.
        fidelity: As of ``volery simulate``.
        limit_ns: Wall time that a run may take, ns.
        memory_b: Resident memory that the process of a run may use, bytes; None for no limit.
    """

    space: Annotated[
        Mapping[str, Parameter], MapOf(_Parameter(), free=True), "Parameters by the paths that they set."
    ] = field(default_factory=dict)
    plan: Annotated[str, OneOf(METHODS), "How the space is sampled."] = GRID
    points: Annotated[int, Whole(least=0), "Number of points of the plan; a grid has its own."] = 0
    seeds: Annotated[int, Whole(least=1), "Number of runs of each variant, with different seeds."] = 1
    seed: Annotated[int, Whole(least=0), "Seed of the plan and of the seeds of runs."] = 1
    common: Annotated[bool, OneOf((True, False)), "Whether all variants have the same seeds."] = True
    fidelity: Annotated[str, OneOf(FIDELITIES), "As of `volery simulate`."] = "code"
    limit_ns: Annotated[Ns, PERIOD, "Wall time that a run may take."] = 3600 * S
    memory_b: Annotated[float | None, DATA_SIZE, "Resident memory that the process of a run may use."] = None

    def run_points(self) -> Iterator[VariantPoint]:
        """Yield the point of each run: all seeds of a variant, then the next variant."""
        run = 0
        for values in SamplingPlan(self.plan, self.points).variants(self.space, self.seed):
            for repetition in range(self.seeds):
                yield VariantPoint(values, run_seed(self.seed, repetition if self.common else run))
                run += 1

    def plain(self) -> dict[str, Any]:
        """Return it as it is written in YAML, as plain data."""
        memory = {} if self.memory_b is None else {"memory": f"{self.memory_b:g} B"}
        return {
            "space": {path: parameter_text(one) for path, one in self.space.items()},
            "plan": self.plan,
            "points": self.points,
            "seeds": self.seeds,
            "seed": self.seed,
            "common": self.common,
            "fidelity": self.fidelity,
            "limit": f"{self.limit_ns / S!r} s",
            **memory,
        }


def run_seed(root: int, number: int) -> int:
    """Return the seed of the run or of the repetition *number* of a campaign with the seed *root*.

    Seeds of different numbers are independent: ``SeedSequence(root, spawn_key=(number,))``.
    """
    return int(np.random.SeedSequence(root, spawn_key=(number,)).generate_state(1)[0])


_SPECIFICATION = Record(Specification)
_NO_NAMES = Vocabulary({}, frozenset())


def specification_of(model: str | FilePath | ModelBuilder, file: FilePath | None = None) -> Specification:
    """Return what a model, or the file beside it, says about its exploration; the defaults if nothing.

    Args:
        model: The model, as of ``volery.simulate``.
        file: A file with the section; by default ``explore.yaml`` in the folder of the model, if it is there.

    Raises:
        ModelError: What is wrong, with file and line; all of it at once.
    """
    node: TextNode | None = None
    if isinstance(model, ModelBuilder):
        node = model.root.at(SECTION)
    else:
        beside = model_file(model).parent / EXPLORE_FILE
        file = beside if file is None and beside.exists() else file
        node = read_tree(model_file(model)).at(SECTION)
    if file is not None:
        node = _from_file(file)
    return Specification() if node is None else read_specification(node)


def _from_file(file: FilePath) -> TextNode:
    try:
        root = parse(read_text(file), str(file))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{file} cannot be read: {error}") from error
    node = root.at(SECTION)
    if node is None:
        raise ModelError("the key `explore` is missing", "", Location(str(file), 1))
    return node


def read_specification(node: TextNode | Mapping[str, Any]) -> Specification:
    """Return the specification that is written at *node*, or in plain data. Raises ``ModelError``."""
    if not isinstance(node, TextNode):
        node = plain_node(node, Location("explore", 0))
    root = TextNode({"explore": node}, node.where)
    problems = Problems(root.locate)
    reading = ModelReading(root, problems, _NO_NAMES, FilePath(), root)
    _, made = read_child(_SPECIFICATION, node, SECTION, reading)
    if made is not None:
        for path in made.space:
            if not path.strip():
                problems.add((*SECTION, "space"), "a parameter needs a path")
    problems.raise_if_any()
    specification: Specification = made
    return specification


def parameter_from_option(text: str) -> tuple[str, Parameter]:
    """Return path and parameter of an option ``--set path=values``; values are YAML, or joined by commas.

    Raises:
        UsageError: It has no path, or no values.
    """
    path, _, _ = text.partition("=")
    change = change_from_option(text)
    where = Location(f"--set {text}", 0)
    node = change.value
    try:
        if isinstance(node.value, str) and not node.quoted and "," in node.value:
            node = TextNode([parse_value(word, where) for word in node.value.split(",")], where)
        return path.strip(), read_parameter(node)
    except UsageError as error:
        raise UsageError(f"--set {text}: {error}") from None
