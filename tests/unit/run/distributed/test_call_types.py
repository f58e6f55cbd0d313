"""Service types of operations: what they look like, what travels, what is refused by its name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveHome, Position
from volery.model.system_loader import load
from volery.ros.messages import define_all, from_cdr, from_ros1, to_cdr, to_ros1
from volery.run.assembly.model_checks import vocabulary
from volery.run.distributed.call_types import call_types

DELIVERY = Path(__file__).parents[4] / "examples" / "delivery"


@pytest.fixture(scope="module")
def types():
    made = call_types(load(DELIVERY, vocabulary()))
    define_all(made.definitions)
    return made


def test_every_operation_of_the_delivery_has_a_type(types):
    assert types.package == "hospital_delivery_interfaces"
    assert len(types.operations) == 10
    text = types.definitions["hospital_delivery_interfaces/srv/RoutingGetRoute"]
    assert text == (
        "hospital_delivery_interfaces/Position start\nhospital_delivery_interfaces/Position goal\n"
        "string vehicle\n---\nbool done\nstring error\nhospital_delivery_interfaces/Position[] result\n"
    )
    assert types.definitions["hospital_delivery_interfaces/msg/Receipt"] == "string parcel\nstring reason\n"


HERE, THERE = Position(43.5, -3.8, AMSL(25.0)), Position(43.6, -3.9, AboveHome(10.0))


@pytest.mark.parametrize(("encode", "decode"), [(to_cdr, from_cdr), (to_ros1, from_ros1)])
def test_arguments_and_results_travel(types, encode, decode):
    kind = types.operations["Routing", "get_route"]
    asked = types.request(kind, (HERE,), {"goal": THERE, "vehicle": "rover"}, "the call")
    asked = decode(f"{kind.name}_Request", encode(asked))
    assert types.arguments(kind, asked, lambda module: None) == {
        "start": HERE, "goal": THERE, "vehicle": "rover",
    }  # fmt: skip
    answer = decode(f"{kind.name}_Response", encode(types.response(kind, (HERE, THERE), "the result")))
    assert answer.done
    assert types.result(kind, answer, lambda module: None) == [HERE, THERE]
    failed = decode(f"{kind.name}_Response", encode(types.failure(kind, "no way")))
    assert (failed.done, failed.error) == (False, "no way")


@dataclass(frozen=True)
class Receipt:
    parcel: str
    reason: str = ""


def test_dataclasses_are_made_of_the_module_beside_the_components(types):
    kind = types.operations["Delivery", "order"]
    answer = types.response(kind, Receipt("parcel-1"), "the result")
    beside = {"delivery_types": SimpleNamespace(Receipt=Receipt)}
    assert types.result(kind, answer, beside.get) == Receipt("parcel-1")
    with pytest.raises(UsageError, match=r"no class Receipt in delivery_types\.py"):
        types.result(kind, answer, lambda module: None)


@pytest.mark.parametrize(
    ("operation", "args", "message"),
    [
        (("Routing", "get_route"), (HERE, THERE), "state each of .start, goal, vehicle. once"),
        (("Routing", "get_route"), (HERE, THERE, 3), "vehicle is no str, but 3"),
        (("Routing", "get_route"), (HERE, None, "rover"), "goal is no Position, but None"),
        (("AirTransport", "fly"), ("job", HERE), "route is no list of Position"),
        (("AirTransport", "fly"), ("job", [HERE, 4]), "route is no Position, but 4"),
    ],
)
def test_what_does_not_fit_is_named(types, operation, args, message):
    with pytest.raises(UsageError, match=message):
        types.request(types.operations[operation], args, {}, "the arguments of x")


def test_results_that_do_not_fit_are_named(types):
    with pytest.raises(UsageError, match="the result is no Receipt, but 'yes'"):
        types.response(types.operations["Delivery", "order"], "yes", "the result")
    with pytest.raises(UsageError, match="the result is no bool, but 1"):
        types.response(types.operations["AirTransport", "fly"], 1, "the result")


ODD = """
volery: 1
name: 7 odd
interfaces:
  Odd:
    a: {args: {Upper: str}}
    b: {args: {x: dict}}
    c: {args: {x: Unknown}}
    d: {args: {x: "str[]"}, returns: Loop}
components: {A: {language: python, path: odd.py, provides: {odd: Odd}}}
application: {a: {is: A}}
platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {one: {a: pc}}
"""


ODD_FILE = """
from dataclasses import dataclass

@dataclass
class Loop:
    x: dict[str, int]

class A:
    def a(self, Upper): ...
    def b(self, x): ...
    def c(self, x): ...
    def d(self, x): ...
"""


def test_operations_without_a_type_are_left_out(tmp_path):
    (tmp_path / "model.yaml").write_text(ODD)
    (tmp_path / "odd.py").write_text(ODD_FILE)
    types = call_types(load(tmp_path, vocabulary()))
    assert types.package == "pkg_7_odd_interfaces"
    assert types.operations == {}
