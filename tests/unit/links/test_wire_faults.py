from __future__ import annotations

from itertools import pairwise

import pytest

from volery.base.errors import UsageError
from volery.base.seeds import stream
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.wire_faults import WireFaults, faulty_pair, parse_wire_faults

COUNT = 400


def arrivals(faults: WireFaults, seed: int = 1) -> tuple[list[tuple[int, int]], object]:
    """Return (time, number) of the arrived ones of 400 frames sent every 10 ms, and the statistics."""
    kernel = VirtualKernel()
    ours, theirs = faulty_pair(kernel, "radio", faults, stream(seed, "radio"))
    seen: list[tuple[int, int]] = []
    ours.receive(lambda frame: seen.append((kernel.now(), frame.fields["seq"])))
    for number in range(COUNT):
        frame = Frame("MISSION_CURRENT", {"seq": number}, 1, 1)
        kernel.call_at(number * 10 * MS, lambda frame=frame: theirs.send(frame))
    kernel.run(10 * S)
    return seen, ours.statistics


def test_without_faults_all_arrive_after_the_delay() -> None:
    seen, _ = arrivals(WireFaults())
    assert seen == [(number * 10 * MS + MS, number) for number in range(COUNT)]


def test_frames_are_dropped_as_often_as_stated_and_the_same_ones_for_the_same_seed() -> None:
    seen, _ = arrivals(WireFaults(drop=0.25))
    assert 0.65 * COUNT < len(seen) < 0.85 * COUNT
    assert seen == arrivals(WireFaults(drop=0.25))[0]
    assert seen != arrivals(WireFaults(drop=0.25), seed=2)[0]


def test_turned_bits_are_caught_by_the_checksum() -> None:
    seen, statistics = arrivals(WireFaults(flip=0.01))
    assert len(seen) < COUNT
    assert statistics.corrupt > 0
    assert [number for _, number in seen] == sorted(number for _, number in seen)


def test_a_burst_garbles_frames_in_a_row() -> None:
    seen, _ = arrivals(WireFaults(burst=0.02))
    numbers = [number for _, number in seen]
    gaps = [later - earlier - 1 for earlier, later in pairwise(numbers)]
    assert max(gaps) >= 2


def test_jitter_delays_and_nothing_overtakes() -> None:
    seen, _ = arrivals(WireFaults(jitter=50 * MS))
    assert [number for _, number in seen] == list(range(COUNT))
    assert max(when - number * 10 * MS for when, number in seen) > 20 * MS


def test_nothing_passes_while_the_wire_is_cut() -> None:
    seen, _ = arrivals(WireFaults(cuts=((S, 2 * S),)))
    assert [number for _, number in seen] == [*range(100), *range(200, COUNT)]


def test_some_arrive_twice() -> None:
    seen, _ = arrivals(WireFaults(duplicate=0.25))
    numbers = [number for _, number in seen]
    assert set(numbers) == set(range(COUNT))
    assert 1.15 * COUNT < len(numbers) < 1.35 * COUNT


def test_some_are_overtaken_and_none_is_lost() -> None:
    seen, _ = arrivals(WireFaults(reorder=0.1))
    numbers = [number for _, number in seen]
    assert sorted(numbers) == list(range(COUNT))
    behind = sum(later < earlier for earlier, later in pairwise(numbers))
    assert 0.05 * COUNT < behind < 0.15 * COUNT


def test_a_frame_that_ends_too_early_spoils_itself_and_at_most_its_neighbour() -> None:
    seen, _ = arrivals(WireFaults(truncate=0.1))
    assert 0.75 * COUNT < len(seen) < 0.95 * COUNT
    assert [number for _, number in seen] == sorted(number for _, number in seen)


def test_faults_that_begin_and_end_while_it_is_in_use() -> None:
    kernel = VirtualKernel()
    ours, theirs = faulty_pair(kernel, "radio", WireFaults(), stream(1, "radio"))
    seen: list[int] = []
    ours.receive(lambda frame: seen.append(frame.fields["seq"]))
    for number, faults in enumerate((WireFaults(), WireFaults(drop=1.0), WireFaults())):
        ours.set_faults(faults)
        theirs.send(Frame("MISSION_CURRENT", {"seq": number}, 1, 1))
        kernel.run(kernel.now() + S)
    assert seen == [0, 2]


def test_faults_as_an_address_states_them() -> None:
    stated = {"drop": "0.01", "flip": "1e-5", "burst": "0.001", "jitter": "0.05", "cut": "20-25,60-70"}
    assert parse_wire_faults(stated) == WireFaults(
        drop=0.01, flip=1e-5, burst=0.001, jitter=50 * MS, cuts=((20 * S, 25 * S), (60 * S, 70 * S))
    )
    stated = {"duplicate": "0.1", "reorder": "0.2", "truncate": "0.3"}
    assert parse_wire_faults(stated) == WireFaults(duplicate=0.1, reorder=0.2, truncate=0.3)


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"drop": "2"}, "no probability"),
        ({"drop": "much"}, "not a number"),
        ({"cut": "20"}, "FROM-TO"),
        ({"drp": "0"}, "did you mean 'drop'"),
    ],
)
def test_faults_that_make_no_sense(stated: dict[str, str], expected: str) -> None:
    with pytest.raises(UsageError, match=expected):
        parse_wire_faults(stated)
