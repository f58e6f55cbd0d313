"""Whatever arrives, nothing but errors of this project comes of it, and nothing piles up."""

from __future__ import annotations

import tracemalloc
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.seeds import stream
from volery.base.time import MS
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzlink_messages import DATALINK, TELEMETRY, message_type_of
from volery.testing.fuzzing import SEALS, FuzzTarget, Mutator, fuzz
from volery.vehicles.driver import drivers

RECORDED = Path(__file__).parents[1] / "golden" / "frames" / "mavlink.txt"
FEW, MANY = 40_000, 1_000_000
EARLY = 5
"""The part of all frames after which everything that is kept is there: one in so many."""
MOST_GROWTH = 1_000_000
"""Bytes."""


def recorded(firmware: str) -> list[bytes]:
    lines = RECORDED.read_text(encoding="ascii").splitlines()
    return [bytes.fromhex(line.split()[1]) for line in lines if line.startswith(firmware)]


def made_up() -> list[bytes]:
    """One frame of every pprzlink message that is known: nobody has recorded any."""
    kinds = [message_type_of(sort, number) for sort in (TELEMETRY, DATALINK) for number in range(256)]
    return [PPRZLINK.encode(Frame(kind.name, {}, 1, 0), 0) for kind in kinds if kind is not None] * 3


def frames_for(driver: str) -> list[bytes]:
    """What its autopilot and its ground stations say."""
    return {"ardupilot": lambda: recorded("ardu"), "px4": lambda: recorded("px4")}.get(driver, made_up)()


class Growth:
    """What is allocated after a fifth of *count* frames and at the end."""

    def __init__(self, count: int) -> None:
        self._count = count
        self.early = self.late = 0

    def look(self, fed: int) -> None:
        self.late = tracemalloc.get_traced_memory()[0]
        if fed == self._count // EARLY:
            self.early = self.late


@pytest.mark.parametrize("driver", ["ardupilot", "px4", "paparazzi"])
@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.long)])
def test_fuzzing_leaves_nothing_behind(driver: str, count: int) -> None:
    growth = Growth(count)
    tracemalloc.start()
    try:
        campaign = fuzz(driver, frames_for(driver), count, after=growth.look)
    finally:
        tracemalloc.stop()
    assert campaign.fed == count
    assert campaign.received > 0.5 * count
    assert sum(campaign.ended.values()) > 100  # its program was not stuck
    assert growth.early > 0
    assert growth.late - growth.early < MOST_GROWTH


def test_the_same_seed_gives_the_same_campaign() -> None:
    frames = recorded("ardu")
    first, second, other = (
        [data for data, _ in zip(Mutator("MAVLink", frames, stream(seed, "x")), range(500), strict=False)]
        for seed in (1, 1, 2)
    )
    assert first == second
    assert first != other


@st.composite
def spoiled(draw: st.DrawFn, protocol: str, frames: Sequence[bytes]) -> bytes:
    """A recorded frame with a few bytes changed, and a checksum that is right or is not."""
    frame = bytearray(draw(st.sampled_from(frames)))
    for place, octet in draw(st.lists(st.tuples(st.integers(0, 300), st.integers(0, 255)), max_size=8)):
        frame[place % len(frame)] = octet
    return SEALS[protocol](frame) if draw(st.booleans()) else bytes(frame)


@pytest.mark.parametrize("driver", ["ardupilot", "px4", "paparazzi"])
def test_no_frames_break_a_driver(driver: str) -> None:
    factory, frames = drivers.load(driver), frames_for(driver)
    open_driver = factory.on_link
    assert open_driver is not None

    @settings(max_examples=400, deadline=None)
    @given(st.lists(spoiled(factory.codec.name, frames), min_size=1, max_size=6))
    def holds(arriving: list[bytes]) -> None:
        kernel = VirtualKernel()
        link = FuzzTarget(kernel, "link", factory.codec)
        opened = open_driver(kernel, link, "craft", {})
        for data in frames[:3]:
            link.arrived(data)
        for data in arriving:
            link.arrived(data)
            kernel.run(kernel.now() + 100 * MS)
        assert opened.telemetry.name == "craft"
        opened.problem()
        opened.close()

    holds()
