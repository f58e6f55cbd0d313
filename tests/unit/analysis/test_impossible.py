import pytest

from volery.analysis.impossible import why_impossible
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

MODEL = """
volery: 1
name: pictures
components:
  Finder:
    language: python
    path: finder.py
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    active: {deadline: 100 ms}
    activation: {time: 20 ms, best: 10 ms, worst: 90 ms}
    assume: {period: 100 ms, beside: {time: 60 ms, best: 50 ms}}
    memory: 2 GB
  Loop:
    language: python
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    active: {period: 100 ms}
    activation: {time: 20 ms, best: 10 ms}
application: {finder: {is: Finder}, loop: {is: Loop}}
platform:
  processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz, cores: 1}}
allocations: {only: {finder: pc, loop: pc}}
requirements:
  in_time: {observe: finder.deadline_misses, max: 0}
"""


@pytest.fixture
def reasons(tmp_path):
    def why(*overrides, fidelity="times"):
        (tmp_path / "finder.py").write_text("class Finder:\n    def run(self): ...\n")
        (tmp_path / "model.yaml").write_text(MODEL)
        system = load(tmp_path / "model.yaml", vocabulary(), overrides=overrides)
        return list(why_impossible(system, fidelity))

    return why


def test_shortest_times_decide(reasons):
    assert not reasons()  # 60 ms at least
    (late,) = reasons("platform.processors.pc.frequency=750 MHz")
    assert late == "finder takes 120.0 ms at least on pc: in_time cannot be met"
    assert not reasons("platform.processors.pc.frequency=950 MHz")  # 94.7 ms at least, far more at most


def test_what_is_not_certain_counts_nothing(reasons):
    slow = "platform.processors.pc.frequency=750 MHz"
    assert not reasons(slow, "requirements.in_time.max=1")
    assert not reasons(slow, "components.Finder.assume.beside={time: 60 ms}")  # it may be nothing at all
    assert not reasons(slow, "components.Finder.at={processor: intel-i5-3470, frequency: 3 GHz}")


def test_in_fidelity_code_what_is_stated_of_code_counts_nothing(reasons):
    slow = "platform.processors.pc.frequency=750 MHz"  # 100 ms of pictures, and 20 ms that are stated
    assert reasons(slow)
    assert not reasons(slow, fidelity="code")


def test_a_response_time_that_no_activation_keeps(reasons):
    (late,) = reasons("requirements.in_time={observe: loop.response_time, max: 9 ms}")
    assert late == "loop takes 10.0 ms at least on pc: in_time cannot be met"
    assert not reasons("requirements.in_time={observe: loop.response_time, max: 11 ms}")


def test_overload_and_memory(reasons):
    (full,) = reasons("components.Loop.active.period=9 ms")
    assert full == "pc has more to execute than it can"
    (small,) = reasons("platform.processors.pc.memory=1 GB")
    assert small == "pc has less memory than finder needs"
