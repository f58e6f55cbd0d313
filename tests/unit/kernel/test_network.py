"""The law of networks, by hand, and its statistics."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from volery.base.errors import LinkError, UsageError
from volery.base.seeds import stream
from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.network import Network
from volery.kernel.task import Task
from volery.kernel.virtual import VirtualKernel

Spawn = Callable[..., Task]


class Scripted(Random):
    """A stream that loses exactly the sendings it is told to: 1 is lost, 0 arrives."""

    def __init__(self, fates: str) -> None:
        super().__init__(0)
        self._fates = iter(fates)

    def random(self) -> float:
        return 0.0 if next(self._fates, "0") == "1" else 0.99


def network(kernel: Kernel, fates: str = "") -> Network:
    """1 byte takes 1 ms of the medium and arrives 5 ms later."""
    return Network(kernel, "radio", bandwidth_bit_s=8000, latency=5 * MS, loss=0.5, stream=Scripted(fates))


def test_one_sender_at_a_time_then_latency(virtual: VirtualKernel) -> None:
    radio = network(virtual)
    arrived: list[tuple[str, float]] = []

    def send(name: str, size: int) -> None:
        radio.send(size, lambda: arrived.append((name, virtual.now() / MS)))

    virtual.call_at(0, lambda: (send("a", 10), send("b", 2)))
    virtual.call_at(11 * MS, lambda: send("c", 1))
    virtual.call_at(50 * MS, lambda: send("d", 1))
    virtual.run(S)
    assert arrived == [("a", 15), ("b", 17), ("c", 18), ("d", 56)]


def test_best_effort_is_lost_and_takes_the_medium_all_the_same(virtual: VirtualKernel) -> None:
    radio = network(virtual, "101")
    seen: list[tuple[str, float]] = []
    for name in "abc":
        radio.send(
            10,
            lambda name=name: seen.append((name, virtual.now() / MS)),
            lambda name=name: seen.append((f"{name} lost", virtual.now() / MS)),
        )
    virtual.run(S)
    assert seen == [("a lost", 15), ("b", 25), ("c lost", 35)]


def test_what_must_arrive_is_sent_again_and_takes_longer(virtual: VirtualKernel) -> None:
    radio = network(virtual, "110")
    arrived: list[float] = []
    radio.send_reliable(10, lambda: arrived.append(virtual.now() / MS))
    virtual.run(S)
    # sent at 0, again at 0 + 2 * 5 + 10 = 20, again at 40; arrives at 40 + 10 + 5
    assert arrived == [55]


def test_a_stream_is_delivered_in_order_and_does_not_hold_up_others(virtual: VirtualKernel) -> None:
    radio = network(virtual, "100")
    arrived: list[tuple[str, float]] = []
    for name, one in (("a1", "a"), ("a2", "a"), ("b1", "b")):
        radio.send_reliable(10, lambda name=name: arrived.append((name, virtual.now() / MS)), one)
    virtual.run(S)
    # a1 is lost and would be sent again at 20, but the medium is taken until 30 by a2 and b1
    assert arrived == [("b1", 35), ("a1", 45), ("a2", 45)]


def test_carry_blocks_until_it_has_arrived(virtual: VirtualKernel, spawn: Spawn) -> None:
    radio = network(virtual, "010")
    seen: list[float] = []

    def body() -> None:
        for _ in range(2):
            radio.carry(10)
            seen.append(virtual.now() / MS)

    spawn(body)
    virtual.run(S)
    assert seen == [15, 50]


def test_carry_past_its_deadline_raises_and_gives_up(virtual: VirtualKernel, spawn: Spawn) -> None:
    radio = network(virtual, "1" * 100)
    seen: list[str] = []

    def body() -> None:
        with pytest.raises(LinkError) as caught:
            radio.carry(10, deadline=100 * MS)
        seen.append(str(caught.value))

    spawn(body)
    virtual.run(10 * S)
    assert seen == ["radio: 10 bytes did not get through within 0.1 s"]
    assert virtual.now() == 100 * MS  # nothing is left to happen


def test_carry_of_a_task_that_is_ended_gives_up(virtual: VirtualKernel, spawn: Spawn) -> None:
    scope = virtual.root.child("components")
    radio = network(virtual, "1" * 100)
    spawn(lambda: radio.carry(10), scope=scope)
    virtual.call_at(30 * MS, lambda: virtual.cancel(scope, "enough"))
    virtual.run(10 * S)
    assert virtual.now() == 30 * MS


def test_the_wall_carries_too(kernel: Kernel, spawn: Spawn) -> None:
    radio = network(kernel, "10")
    seen: list[str] = []
    spawn(lambda: (radio.carry(10), seen.append("carried")))
    kernel.run(1000 * S)
    assert seen == ["carried"]


def test_losses_are_as_frequent_as_stated_and_depend_on_the_stream_alone(virtual: VirtualKernel) -> None:
    def lost(seed: int) -> list[int]:
        radio = Network(
            virtual, "radio", bandwidth_bit_s=8000, latency=0, loss=0.2, stream=stream(seed, "radio")
        )
        seen: list[int] = []
        for number in range(5000):
            radio.send(1, lambda: None, lambda number=number: seen.append(number))
        virtual.run(virtual.now() + 10 * S)
        return seen

    first = lost(1)
    assert 0.18 < len(first) / 5000 < 0.22  # 3.5 sigma
    assert lost(1) == first
    assert lost(2) != first


@pytest.mark.parametrize(
    ("bandwidth", "size", "expected"), [(8_000_000_000, 1, 1), (3, 1, 2_666_666_667), (8, 0, 0)]
)
def test_serialisation_is_rounded_up(
    virtual: VirtualKernel, bandwidth: int, size: int, expected: int
) -> None:
    radio = Network(virtual, "radio", bandwidth_bit_s=bandwidth, latency=0, loss=0.0, stream=Random(1))
    assert radio.serialisation(size) == expected


@pytest.mark.parametrize(
    "wrong", [{"bandwidth_bit_s": 0}, {"latency": -1}, {"loss": 1.5}, {"loss": float("nan")}]
)
def test_a_network_that_cannot_be_is_refused(virtual: VirtualKernel, wrong: dict[str, float]) -> None:
    stated = {"bandwidth_bit_s": 1000, "latency": 0, "loss": 0.0, **wrong}
    with pytest.raises(UsageError, match="radio: bandwidth"):
        Network(virtual, "radio", stream=Random(1), **stated)
