"""Streams of one link: periods, bursts, what stops."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.mavlink_messages import MessageStreams

ORDER = ("A", "B", "C")


class Listener:
    """Streams and what they sent when, in milliseconds."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel()
        self.bursts: list[tuple[int, tuple[str, ...]]] = []
        self.wanted = "ABCX"
        self.streams = MessageStreams(self.kernel, ORDER, self.burst, wanted=lambda name: name in self.wanted)

    def use(self, names: str) -> None:
        self.wanted = names
        self.streams.resume()

    def burst(self, names: Sequence[str]) -> None:
        self.bursts.append((self.kernel.now() // MS, tuple(names)))

    def run(self, milliseconds: int) -> None:
        end = self.kernel.now() + milliseconds * MS
        self.kernel.call_at(end, lambda: None)  # time stands still where nothing happens
        self.kernel.run(end)


@pytest.fixture
def listener() -> Listener:
    return Listener()


def test_nothing_is_sent_before_the_start_but_remembered(listener: Listener) -> None:
    listener.streams.set(["A"], 100 * MS)
    listener.run(500)
    assert not listener.bursts
    listener.streams.start()
    listener.run(250)
    assert listener.bursts == [(600, ("A",)), (700, ("A",))]


def test_messages_of_one_period_come_together_in_order(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["C", "A"], 100 * MS)
    listener.streams.set(["X", "B"], 100 * MS)
    listener.run(150)
    assert listener.bursts == [(100, ("A", "B", "C", "X"))]


def test_a_message_has_one_period(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["A"], 100 * MS)
    listener.streams.set(["A"], 200 * MS)
    listener.run(450)
    assert listener.bursts == [(200, ("A",)), (400, ("A",))]
    assert listener.streams.period("A") == 200 * MS
    assert listener.streams.period("B") == 0


def test_zero_stops_one_and_leaves_the_others(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["A", "B"], 100 * MS)
    listener.run(150)
    listener.streams.set(["A"], 0)
    listener.run(100)
    assert listener.bursts == [(100, ("A", "B")), (200, ("B",))]


def test_asking_again_for_what_comes_already_does_not_delay_it(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["A"], S)
    for _ in range(3):
        listener.run(700)
        listener.streams.set(["A"], S)
    assert [at for at, _ in listener.bursts] == [1000, 2000]


def test_a_stop_forgets_everything(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["A"], 100 * MS)
    listener.streams.stop()
    listener.streams.start()
    listener.run(500)
    assert not listener.bursts


def test_a_burst_of_which_nothing_is_used_is_suspended_and_resumes_in_phase(listener: Listener) -> None:
    listener.streams.start()
    listener.streams.set(["A", "B"], 100 * MS)
    listener.use("B")
    listener.run(250)
    assert listener.bursts == [(100, ("B",)), (200, ("B",))]
    listener.use("")
    listener.run(1100)
    listener.use("A")
    listener.run(200)
    assert listener.bursts[2:] == [(1400, ("A",)), (1500, ("A",))]


def test_a_suspended_burst_has_no_timer(listener: Listener) -> None:
    listener.streams.start()
    listener.use("")
    listener.streams.set(["A"], 100 * MS)
    listener.run(150)
    for _ in range(5):
        listener.kernel.run(10 * S)
    assert listener.kernel.now() == 150 * MS, "time stands still where nothing is due"


def test_a_suspended_burst_that_is_stopped_does_not_resume(listener: Listener) -> None:
    listener.streams.start()
    listener.use("")
    listener.streams.set(["A"], 100 * MS)
    listener.run(250)
    listener.streams.set(["A"], 0)
    listener.use("A")
    listener.run(250)
    assert not listener.bursts
    listener.streams.set(["A"], 100 * MS)
    listener.run(150)
    assert listener.bursts == [(600, ("A",))]
