import numpy as np

from volery.cost.native.instrumented_run import BlockTrace, trace_of

ACCESS, SWITCH = 1 << 30, 1 << 31


def access(number: int, address: int, *, store: int = 0, ahead: int = 0, level: int = 0) -> list[int]:
    return [ACCESS | number << 5 | store << 4 | ahead << 3 | level, ACCESS | address]


def test_values_of_switches_stand_between_blocks_with_their_sign() -> None:
    words = np.array([4, SWITCH | 65, 5, 6, SWITCH | (-3 & 0x7FFFFFFF), 4], dtype=np.uint32)
    assert trace_of(words) == BlockTrace([4, 5, 6, 4], {1: 65, 3: -3})


def test_a_value_stays_before_the_next_block_that_is_followed() -> None:
    assert BlockTrace([4, 5, 6, 7], {1: 65, 2: 66, 3: 67}).only({4, 6, 7}) == BlockTrace(
        [4, 6, 7], {1: 65, 2: 67}, {1: 5}
    )


def test_accesses_belong_to_the_block_before_them() -> None:
    words = [*access(9, 64), 4, *access(2, 4096, ahead=1, level=2), *access(3, 8, store=1), 5, 6]
    assert trace_of(np.array(words, dtype=np.uint32)).accesses.tolist() == [
        [0, 2, 2, 1, 4096],
        [0, 3, 0, 0, 8],
    ]


def test_a_trace_that_was_cut_within_an_access_is_read_to_there() -> None:
    words = np.array([4, *access(2, 64), *access(3, 8)[:1]], dtype=np.uint32)
    assert trace_of(words).accesses.tolist() == [[0, 2, 0, 0, 64]]


def trace() -> BlockTrace:
    accesses = np.array([[0, 0, 0, 0, 8], [1, 5, 1, 0, 64], [2, 1, 1, 0, 16]])
    return BlockTrace([4, 5, 6], accesses=accesses)


def test_accesses_of_a_block_that_is_left_out_are_of_the_one_before() -> None:
    assert trace().only({4, 6}).accesses[:, :2].tolist() == [[0, 0], [0, 5], [1, 1]]


def test_a_part_of_a_trace_has_the_accesses_of_its_blocks() -> None:
    assert trace().until(2).accesses[:, :2].tolist() == [[0, 0], [1, 5]]
    assert trace().then(trace()).accesses[:, 0].tolist() == [0, 1, 2, 3, 4, 5]


def test_an_access_after_a_call_is_of_the_block_that_called() -> None:
    calling, called = 4, 5
    accesses = np.array([[1, 0, 0, 0, 8], [2, 1, 0, 0, 16], [4, 1, 0, 0, 24]])
    found = BlockTrace([6, calling, called, calling, called], accesses=accesses)
    moved = found.at_their_blocks([calling, calling])
    assert moved.accesses[:, 0].tolist() == [1, 1, 3]
