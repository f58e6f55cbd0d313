"""Values of ports between processes, as text and back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.position import AMSL, Position
from volery.components.loader import Loader
from volery.run.distributed.remote_ports import ValueCodec

TYPES = """
from dataclasses import dataclass
from enum import Enum

from volery import Position

class Stage(Enum):
    LOADING = "loading"

@dataclass(frozen=True)
class Status:
    where: Position
    stage: Stage
    jobs: tuple
    notes: dict
"""


@pytest.fixture
def shared(tmp_path: Path) -> tuple[ModuleType, ValueCodec]:
    """A module beside the components' files, and the values of a process that knows it."""
    (tmp_path / "station_types.py").write_text(TYPES)
    loader = Loader()
    module = loader.sibling("station_types", tmp_path)
    assert module is not None
    return module, ValueCodec(lambda name: loader.sibling(name, tmp_path))


def test_values_arrive_as_they_were(shared: tuple[ModuleType, ValueCodec]) -> None:
    module, values = shared
    where = Position(43.47, -3.83, AMSL(25.5))
    status = module.Status(where, module.Stage.LOADING, (1, "a", None), {"!": [2.5, True], "b": {3: ()}})
    asked = [[status, float("inf"), ["x", (where,)]], {"note": "ä"}]
    assert values.from_text(values.to_text(asked, "it")) == asked


class Unknown:
    pass


class Colour(Enum):
    RED = 1


@dataclass
class Ours:
    x: int


@pytest.mark.parametrize("value", [Unknown(), {1, 2}, b"bytes", Ours(1), Colour.RED, Position, print])
def test_what_cannot_leave_its_process_is_named(value: Any, shared: tuple[ModuleType, ValueCodec]) -> None:
    with pytest.raises(UsageError, match=r"the result of a\.b: a \w+ cannot be sent to another process"):
        shared[1].to_text([value], "the result of a.b")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        '{"!": "os:system", "value": {}}',
        '{"!": "volery.base.position:Position", "value": {"latitude": 1.0}}',
        '{"!": "volery.base.position:isfinite", "value": 1}',
        '{"!": "volery.user.shared.nothing:Status", "value": {}}',
        '{"!": "volery.user.shared.station_types:Stage", "value": "EATING"}',
        '{"!": "volery.base.errors:UsageError", "value": {}}',
    ],
)
def test_nothing_is_made_of_what_makes_no_sense(text: str, shared: tuple[ModuleType, ValueCodec]) -> None:
    with pytest.raises(UsageError, match="not the value of a port"):
        shared[1].from_text(text)
