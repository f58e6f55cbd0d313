"""What happens to messages on the private graph of a simulated vehicle."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest

from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.wire_faults import WireFaults
from volery.ros.graph import ServiceError
from volery.ros.messages import message_class, new, request
from volery.run.assembly.vehicle_nodes import GraphWire, private_graph


class Pair:
    """A talker and a listener."""

    def __init__(self, faults: WireFaults | None = None) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        self.wire = GraphWire(self.kernel, Random(5), faults)
        self.graph = private_graph(self.kernel, self.wire, as_bytes=faults is not None)
        here = ExecutionContext("here")
        talker, listener = (self.graph.node(name, context=here) for name in ("talker", "listener"))
        self.heard: list[tuple[int, float]] = []
        group = listener.group(lambda work: work.run())
        listener.subscribe("chat", "std_msgs/Float32", self._take, group=group)
        answer = message_class("std_srvs/srv/Trigger_Response")
        self.calls = 0

        def served(_request: Any) -> Any:
            self.calls += 1
            return answer(success=True)

        listener.serve("ask", "std_srvs/Trigger", served, group)
        self.publisher = talker.advertise("chat", "std_msgs/Float32")
        self.client = talker.client("ask", "std_srvs/Trigger")

    def _take(self, message: Any) -> None:
        self.heard.append((self.kernel.now(), message.data))

    def say(self, count: int, period: int = 10 * MS) -> list[float]:
        """So many numbers; those that were heard."""

        def flow() -> None:
            for number in range(count):
                self.publisher.publish(new("std_msgs/Float32", data=number + 0.1))
                self.kernel.sleep_until(self.kernel.now() + period)

        self.kernel.spawn(flow, "talker", ExecutionContext("talker"))
        self.kernel.run(self.kernel.now() + (count + 200) * period)
        return [number for _, number in self.heard]

    def ask(self) -> str:
        outcome: list[str] = []

        def flow() -> None:
            try:
                self.client.call(request("std_srvs/Trigger"), within=5 * S)
            except ServiceError as error:
                outcome.append(str(error))
            else:
                outcome.append("")

        self.kernel.spawn(flow, "asker", ExecutionContext("asker"))
        self.kernel.call_at(self.kernel.now() + 10 * S, lambda: None)
        self.kernel.run(self.kernel.now() + 10 * S)
        return outcome[0]


def test_whole_it_passes_everything_in_two_milliseconds_and_records_nothing() -> None:
    pair = Pair()
    assert pair.say(100) == [float(np.float32(number + 0.1)) for number in range(100)]
    assert pair.heard[0][0] == 2 * MS
    assert not [event for event in pair.events if type(event).__name__ in ("Message", "Published", "Charge")]


def test_through_bytes_a_number_has_the_digits_of_its_field() -> None:
    pair = Pair(WireFaults())
    assert pair.say(1) == [pytest.approx(0.1, abs=1e-7)]
    assert pair.heard[0][1] != 0.1


@pytest.mark.parametrize(
    ("faults", "expected"),
    [
        (WireFaults(drop=0.2), 800),
        (WireFaults(truncate=0.2), 800),
        (WireFaults(burst=0.2), 800),
        (WireFaults(flip=0.005), 827),  # (1 - 0.005) ** 38 bytes
        (WireFaults(duplicate=1.0), 1000),  # numbered: taken once
    ],
)
def test_what_is_damaged_does_not_pass(faults: WireFaults, expected: int) -> None:
    heard = Pair(faults).say(1000)
    assert len(heard) == pytest.approx(expected, abs=45)
    assert heard == sorted(heard)


def test_what_is_overtaken_comes_late() -> None:
    heard = Pair(WireFaults(reorder=0.1)).say(200)
    assert len(heard) == 200
    assert heard != sorted(heard)


def test_jitter_keeps_the_order() -> None:
    pair = Pair(WireFaults(jitter=100 * MS))
    heard = pair.say(200)
    assert heard == sorted(heard)
    assert len({when % (10 * MS) for when, _ in pair.heard}) > 50


def test_in_a_cut_nothing_passes_and_a_request_is_given_up_without_being_obeyed() -> None:
    pair = Pair(WireFaults(cuts=((0, S),)))
    assert "lost on the way" in pair.ask()
    assert pair.calls == 0
    assert pair.ask() == ""
    assert pair.calls == 1


def test_faults_may_begin_and_end_in_use() -> None:
    pair = Pair()
    assert len(pair.say(10)) == 10
    pair.wire.set_faults(WireFaults(drop=1.0))
    assert len(pair.say(10)) == 10
    pair.wire.set_faults(WireFaults())
    assert len(pair.say(10)) == 20
