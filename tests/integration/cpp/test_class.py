"""A component whose class is written in C++: ports both ways, time, costs, errors."""

from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.calibration.component_profile import profile_components
from volery.calibration.host_machine import Machine, put_law
from volery.cost import load_catalogue
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary
from volery.run.result import Options
from volery.trace.events import Charge, Milestone, Text

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: adders
interfaces:
  Adding:
    add: {args: {a: int, b: int}, returns: int}
    shifted: {args: {points: "Position[]", north: float}, returns: "Position[]"}
  Listing:
    names: {args: {count: int}, returns: "str[]"}
components:
  Adder:
    language: c++
    path: adder.cpp
    provides: {sums: Adding}
    requires: {list: Listing}
    parameters: {rounds: 3}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
    operations: {add: {time: 10 us}, shifted: {time: 10 us}}
  Lister:
    language: python
    path: lister.py
    provides: {list: Listing}
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    operations: {names: {time: 10 us}}
  Caller:
    language: python
    path: caller.py
    requires: {one: Adding, other: Adding}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
application:
  one: {is: Adder, list: lister.list}
  other: {is: Adder, list: lister.list, parameters: {rounds: 0}}
  lister: {is: Lister}
  caller: {is: Caller, one: one.sums, other: other.sums}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {only: {one: pc, other: pc, lister: pc, caller: pc}}
run: {duration: 10 s}
"""

LISTER = """
class Lister:
    def names(self, count):
        if count < 0:
            raise ValueError("less than nothing")
        return [f"item {i}" for i in range(count)]
"""

CALLER = """
import time
import volery
from volery import AMSL, AboveHome, Position
from volery.base.errors import ComponentError

class Caller:
    def __init__(self, one, other):
        self.one, self.other = one, other

    def run(self):
        time.sleep(1.5)
        began = time.monotonic()
        volery.log(f"{self.one.add(1, b=2)} {self.other.add(-1, 1)} {time.monotonic() - began:.3f}")
        there = self.one.shifted([Position(1.0, 2.0, AMSL(3.0)), Position(4.0, 5.0, AboveHome(6.0))], 0.5)
        volery.log(str(there == [Position(1.5, 2.0, AMSL(3.0)), Position(4.5, 5.0, AboveHome(6.0))]))
        try:
            self.one.shifted([], 1.0)
        except ComponentError as error:
            volery.log(str(error))
"""


def test_calls_in_and_out_time_costs_and_errors(run_model):
    outcome = run_model(MODEL, "adder.cpp", lister=LISTER, caller=CALLER)
    assert outcome.run.completed, outcome.run.record.outcome
    said = [(one.source, one.text) for one in outcome.of(Text)]
    assert [text for source, text in said if source == "caller"] == [
        "203 0 1.000",  # one has begun its second round, the other none; both slept in virtual time
        "True",
        "one: shifted raised std::out_of_range: no points",
    ]
    assert [text for source, text in said if source == "one"] == [
        "item 0 of 1",
        "item 0 of 2",
        "item 0 of 3",
        "lister: names raised ValueError: less than nothing (lister.py:5)",
    ]
    [done] = [one for one in outcome.of(Milestone) if one.component == "one"]
    assert float(done.detail) == pytest.approx(3.0, abs=0.1)
    stated = [one.caller for one in outcome.of(Charge) if one.kind == "stated"]
    assert stated == [2_000_000] * 3


def test_the_same_seed_gives_the_same_trace(run_model, tmp_path):
    for out in ("first", "second"):
        run_model(MODEL, "adder.cpp", lister=LISTER, caller=CALLER, out=out)
    first, second = ((tmp_path / out / "trace.mcap").read_bytes() for out in ("first", "second"))
    assert first == second


@pytest.mark.usefixtures("llvm")
def test_code_is_counted_where_the_core_is_known(run_model):
    outcome = run_model(MODEL, "adder.cpp", fidelity="code", lister=LISTER, caller=CALLER)
    assert outcome.run.completed, outcome.run.record.outcome
    counted = dict.fromkeys(("one", "other"), 0)
    for one in outcome.of(Charge):
        if one.kind == "code" and one.component in counted:
            counted[one.component] += one.caller
    assert 0 < counted["other"] < counted["one"] < 100_000, "one of them does a few rounds more"
    [doubt] = _warnings(outcome)
    assert "comes from the code alone" in doubt


@pytest.mark.usefixtures("llvm")
def test_costs_are_profiled_in_a_run(run_model, tmp_path, monkeypatch):
    """From then on the costs are those of what ran; the rest is charged as before."""
    monkeypatch.setenv("VOLERY_CACHE", str(tmp_path / "cache"))
    guessed = run_model(MODEL, "adder.cpp", fidelity="code", out="guessed", lister=LISTER, caller=CALLER)
    (tmp_path / "model.yaml").write_text(MODEL, encoding="utf-8")
    system = load(tmp_path / "model.yaml", vocabulary())
    (kind,), run = profile_components(system, Options())
    assert run.completed
    assert (kind.component, kind.instances, kind.core) == ("Adder", ("one", "other"), "intel-i5-3470")
    assert 10 < kind.met < kind.blocks
    assert kind.followed > 0.9
    learnt = run_model(MODEL, "adder.cpp", fidelity="code", out="learnt", lister=LISTER, caller=CALLER)
    assert _warnings(learnt) == []
    before, after = (_counted(outcome, "one") for outcome in (guessed, learnt))
    assert before != after
    assert after == pytest.approx(before, rel=4.0)
    assert _counted(guessed, "caller") == _counted(learnt, "caller")


def _warnings(outcome) -> list[str]:
    """Return the warnings of the run, but for those that count what components logged."""
    found = [one.text for one in outcome.of(Text) if one.source == "volery"]
    return [text for text in found if " logged " not in text]


def _counted(outcome, component):
    charged = [one for one in outcome.of(Charge) if one.kind == "code" and one.component == component]
    return sum(one.caller for one in charged)


def test_a_model_without_cpp_cannot_be_profiled(tmp_path):
    for name in ("adder.cpp", "lister.py", "caller.py"):
        (tmp_path / name).touch()
    (tmp_path / "model.yaml").write_text(MODEL.replace("language: c++", "language: python"), encoding="utf-8")
    with pytest.raises(UsageError, match="adders: no component of it is C\\+\\+"):
        profile_components(load(tmp_path / "model.yaml", vocabulary()), Options())


@pytest.mark.usefixtures("llvm")
def test_a_core_that_the_model_brings_along_is_counted_for(run_model, tmp_path):
    law = load_catalogue().processor("intel-i5-3470").core_law().model_copy(update={"name": ""})
    machine = Machine("mine", "a computer", 2, 3000.0)
    put_law(tmp_path / "mine.yaml", machine, ("core_model",), law, (1600.0, 3000.0))
    put_law(tmp_path / "mine.yaml", machine, ("code", "python"), python_law(), (1600.0, 3000.0))
    model = MODEL.replace(
        "platform: {processors: {pc: {is: intel-i5-3470,", "platform: {processors: {pc: {is: mine,"
    )
    model = model.replace("platform: {", "platform: {catalogues: [mine.yaml], ")
    there = run_model(model, "adder.cpp", fidelity="code", out="there", lister=LISTER, caller=CALLER)
    assert there.run.completed, there.run.record.outcome
    known = run_model(MODEL, "adder.cpp", fidelity="code", out="known", lister=LISTER, caller=CALLER)
    assert _counted(there, "one") == _counted(known, "one") > 0


def python_law():
    return load_catalogue().processor("intel-i5-3470").code_law().model_copy(update={"processor": ""})
