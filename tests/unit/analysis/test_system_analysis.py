"""Bounds of whole models: worked out by hand, never below a run, refused where they do not hold."""

from __future__ import annotations

import pytest

from volery.analysis.budgets import budgets
from volery.analysis.simulated_times import longest_times
from volery.analysis.system_analysis import analyse
from volery.base.time import MS
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary
from volery.run.result import Options
from volery.run.simulate import simulate

HEAD = """
volery: 1
name: pipeline
"""

PERIODIC = (
    HEAD
    + """
components:
  Loop: {language: python, at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}, active: {period: 7 ms},
         activation: {time: 3 ms}, memory: 12 MB}
application:
  a: {is: Loop, active: {period: 7 ms, priority: 3}}
  b: {is: Loop, active: {period: 12 ms, priority: 2}}
  c: {is: Loop, active: {period: 30 ms, priority: 1}}
platform:
  processors:
    pc: {is: rpi4-cortex-a72, frequency: 1500 MHz, cores: 1}
allocations:
  only: {a: pc, b: pc, c: pc}
"""
)


@pytest.fixture
def system_of(tmp_path):
    def read(text, files=(), *overrides):
        for name, content in dict(files).items():
            (tmp_path / name).write_text(content)
        (tmp_path / "model.yaml").write_text(text)
        return load(tmp_path / "model.yaml", vocabulary(), overrides=overrides)

    return read


def responses(system):
    return {one.subject: one for bounds in analyse(system).responses.values() for one in bounds}


def milliseconds(system):
    return {name: one.bound / MS for name, one in responses(system).items() if one.bound is not None}


def test_fixed_priorities(system_of):
    system = system_of(PERIODIC)
    assert milliseconds(system) == {"a": 3, "b": 6, "c": 12}
    assert [one.share for one in analyse(system).processors] == [pytest.approx(3 / 7 + 3 / 12 + 3 / 30)]
    assert responses(system)["c"].holds is True


def test_other_schedulers(system_of):
    pc = "platform.processors.pc"
    assert milliseconds(system_of(PERIODIC, (), f"{pc}.scheduler=fifo")) == {"a": 9, "b": 9, "c": 9}
    deadline_first = milliseconds(system_of(PERIODIC, (), f"{pc}.scheduler=edf"))
    assert deadline_first["a"] <= 7
    assert deadline_first["c"] <= 30
    refused = responses(system_of(PERIODIC, (), f"{pc}.scheduler=round-robin"))
    assert {one.why for one in refused.values()} == {"there is no analysis of round-robin"}


def test_load_and_context_switches_count(system_of):
    pc = "platform.processors.pc"
    switched = milliseconds(system_of(PERIODIC, (), f"{pc}.context_switch=0.1 ms"))
    assert switched["a"] == pytest.approx(3.2)
    loaded = system_of(PERIODIC, (), f"{pc}.load=10 %")
    assert milliseconds(loaded)["a"] == 3 + 1.5


def test_more_cores_bear_more(system_of):
    found = milliseconds(system_of(PERIODIC, (), "platform.processors.pc.cores=3"))
    assert found["a"] == 3
    assert found["b"] == pytest.approx(3, abs=0.01)


def test_what_is_not_stated_stops_what_it_can_delay(system_of):
    text = PERIODIC.replace("b: {is: Loop, active: {period: 12 ms,", "b: {is: Loop, active: {period: null,")
    found = responses(system_of(text))
    assert found["a"].bound == 3 * MS
    assert "without a period" in found["b"].why
    assert found["c"].why == "b can delay it, and what that executes is not known"
    assert analyse(system_of(text)).processors[0].not_counted


CALLS = (
    HEAD
    + """
interfaces: {Filter: {run: }}
components:
  Caller: {language: python, at: {processor: rpi4-cortex-a72, frequency: 1500 MHz},
           active: {period: 20 ms, priority: 2}, activation: {time: 1 ms}, requires: {filter: Filter},
           calls: {activation: {filter.run: 3}}}
  Filter: {language: python, at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}, provides: {out: Filter},
           operations: {run: {time: 2 ms}}}
application:
  caller: {is: Caller, filter: filter.out}
  filter: {is: Filter}
platform:
  processors:
    pc: {is: rpi4-cortex-a72, frequency: 750 MHz, cores: 1}
    other: {is: rpi4-cortex-a72, frequency: 1500 MHz}
  networks: {wire: {between: [pc, other], bandwidth: 1 Mbit/s}}
allocations:
  near: {caller: pc, filter: pc}
  far: {caller: pc, filter: other}
"""
)


def test_calls_count_at_their_callee(system_of):
    assert milliseconds(system_of(CALLS)) == {"caller": 14}  # (1 + 3 * 2) ms, at half the frequency


def test_calls_that_no_bound_covers_are_named(system_of):
    assert "no bound for tasks that suspend themselves" in responses(far(system_of))["caller"].why
    unstated = CALLS.replace("calls: {activation: {filter.run: 3}}", "parameters: {}")
    assert "add `calls: {activation: {...}}` to Caller" in responses(system_of(unstated))["caller"].why
    shared = CALLS.replace(
        "  filter: {is: Filter}", "  filter: {is: Filter}\n  more: {is: Caller, filter: filter.out}"
    )
    shared = shared.replace("caller: pc,", "caller: pc, more: pc,")
    assert "serves one caller at a time" in responses(system_of(shared))["caller"].why


def test_stated_waits_bound_a_caller_and_its_pauses_what_is_called(system_of):
    text = CALLS.replace(
        "calls: {activation: {filter.run: 3}}}",
        "calls: {activation: {filter.run: 3}}, assume: {pause: 40 ms, waits: 15 ms}}",
    )
    system_of(text)
    system = load(system_of(text).folder / "model.yaml", vocabulary(), allocation="far")
    assert milliseconds(system) == {"caller": 17, "filter for caller": 6}  # 2 + 15 ms; 3 * 2 ms
    shares = [one.share for one in analyse(system).processors]
    assert shares == [pytest.approx(2 / 20), pytest.approx(6 / 40 / 4)]  # waiting is no execution


def far(system_of):
    system_of(CALLS)
    return load(system_of(CALLS).folder / "model.yaml", vocabulary(), allocation="far")


PIPELINE = (
    HEAD
    + """
components:
  Camera: {language: rclpy, path: camera.py, active: {period: 50 ms, priority: 3}, activation: {time: 2 ms},
           calls: {activation: {}}, publishes: {/image: {type: std_msgs/String, size: 400 B}},
           at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}}
  Finder: {language: rclpy, path: finder.py, active: {priority: 2, deadline: 60 ms}, activation: {time: 9 ms},
           calls: {activation: {}}, subscribes: {/image: {type: std_msgs/String}},
           publishes: {/target: {type: std_msgs/String, on: /image, size: 60 B}},
           at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}}
  Control: {language: rclpy, path: control.py, active: {period: 20 ms, priority: 5}, activation: {time: 1 ms},
            calls: {activation: {}}, subscribes: {/target: {type: std_msgs/String}},
            publishes: {/command: {type: std_msgs/String, size: 60 B}},
            at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}}
  Motor: {language: rclpy, path: motor.py, active: {priority: 6}, activation: {time: 0.2 ms},
          calls: {activation: {}}, subscribes: {/command: {type: std_msgs/String}},
          at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}}
application: {camera: {is: Camera}, finder: {is: Finder}, control: {is: Control}, motor: {is: Motor}}
platform:
  processors:
    eye: {is: rpi4-cortex-a72, frequency: 1500 MHz, cores: 1}
    body: {is: rpi4-cortex-a72, frequency: 1500 MHz, cores: 2}
  networks:
    wire: {between: [eye, body], bandwidth: 1 Mbit/s, latency: 1 ms}
allocations:
  split: {camera: eye, finder: eye, control: body, motor: body}
chains: {reaction: [/image, /target, /command]}
run: {duration: 20 s}
"""
)

NODE = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String


class {name}(Node):
    def __init__(self):
        super().__init__("{lower}")
        self.last = "none"
        {setup}

    def publish(self):
        self.out.publish(String(data=self.last.ljust({size})))

    def receive(self, message):
        self.last = message.data[:9]
        {forward}


def main():
    rclpy.init()
    rclpy.spin({name}())


if __name__ == "__main__":
    main()
"""


def node(name, *, sends="", receives="", period=0.0, forward=False, size=40):
    setup = [f'self.out = self.create_publisher(String, "{sends}", 10)'] if sends else []
    setup += [f'self.create_subscription(String, "{receives}", self.receive, 10)'] if receives else []
    setup += [f"self.create_timer({period}, self.publish)"] if period else []
    return NODE.format(
        name=name, lower=name.lower(), setup="\n        ".join(setup), size=size,
        forward="self.publish()" if forward else "pass",
    )  # fmt: skip


FILES = {
    "camera.py": node("Camera", sends="/image", period=0.05, size=300),
    "finder.py": node("Finder", sends="/target", receives="/image", forward=True),
    "control.py": node("Control", sends="/command", receives="/target", period=0.02),
    "motor.py": node("Motor", receives="/command"),
}


def test_no_simulated_time_of_a_pipeline_exceeds_its_bound(system_of, tmp_path):
    system = system_of(PIPELINE, FILES)
    found = analyse(system)
    bounds = {one.subject: one for each in found.responses.values() for one in each}
    assert all(one.bound is not None for one in bounds.values()), bounds
    record = simulate(system, Options("times", out=tmp_path / "run")).record
    assert record.outcome.status == "completed"
    seen = longest_times(tmp_path / "run")
    assert set(seen.responses) == {"camera", "finder", "control", "motor"}
    for name, response in seen.responses.items():
        longest = max(one.bound for subject, one in bounds.items() if subject.split()[0] == name)
        assert response <= longest <= 4 * response, name
    for one in found.processors:
        busy = record.processors[one.resource].utilisation
        assert 0.5 * one.share <= busy <= one.share + 0.05 / 20  # the start-up is not part of it
    assert seen.chains["reaction"] <= found.chains[0].bound <= 3 * seen.chains["reaction"]
    assert all(one.bound > 1 * MS for one in found.delays)


def test_a_network_that_loses_messages_has_no_bound(system_of):
    found = analyse(system_of(PIPELINE, FILES, "platform.networks.wire.loss=1 %"))
    assert "wire loses 1.00%" in found.delays[0].why
    assert "wire loses" in found.chains[0].why or "no bound" in found.chains[0].why
    assert found.networks[0].share > 0


def test_topics_that_depend_on_each_other_end_without_a_bound(system_of):
    text = PIPELINE.replace(
        "subscribes: {/image: {type: std_msgs/String}}",
        "subscribes: {/image: {type: std_msgs/String}, /target: {type: std_msgs/String}}",
    )
    found = responses(system_of(text, FILES))
    assert found["camera"].bound is not None
    assert any(one.bound is None and one.why for name, one in found.items() if name.startswith("finder"))


def test_budgets(system_of):
    system = system_of(PERIODIC)
    found = budgets(system, analyse(system).processors)
    assert [one.bytes for one in found.memory] == [12e6] * 3
    [energy] = found.energy
    assert energy.watts == pytest.approx(2.5, abs=2.0)
    assert energy.joules == pytest.approx(energy.watts * 900)
    assert not energy.at_least


def test_the_worst_time_counts(system_of):
    text = PERIODIC.replace("activation: {time: 3 ms}", "activation: {time: 1 ms, worst: 3 ms}")
    assert milliseconds(system_of(text)) == {"a": 3, "b": 6, "c": 12}


def test_instances_of_a_memory_space_share_its_process(system_of):
    text = PERIODIC.replace("platform:", "memory_spaces: {loops: {memory: 20 MB}}\nplatform:", 1)
    text = text.replace("cores: 1}", "cores: 1, memory: 30 MB}").replace(
        "{a: pc, b: pc, c: pc}", "{a: loops, b: loops, c: pc, loops: pc}"
    )
    system = system_of(text)
    loops, alone, everything = budgets(system, analyse(system).processors).memory
    assert (loops.process, loops.bytes, loops.why) == (
        "loops",
        24e6,
        "more than the 2e+07 B of its memory space",
    )
    assert (alone.process, alone.bytes, alone.why) == ("c", 12e6, "")
    assert (everything.bytes, everything.why) == (36e6, "more than its 3e+07 B")
