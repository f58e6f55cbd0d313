import numpy as np

from volery.cost.native.instrumented_run import Access, BlockTrace, trace_of


def test_values_of_switches_stand_between_blocks_with_their_sign() -> None:
    value = 1 << 31
    words = np.array([4, value | 65, 5, 6, value | (-3 & 0x7FFFFFFF), 4], dtype=np.uint32)
    assert trace_of(words) == BlockTrace([4, 5, 6, 4], {1: 65, 3: -3})


def test_a_value_stays_before_the_next_block_that_is_followed() -> None:
    assert BlockTrace([4, 5, 6, 7], {1: 65, 2: 66, 3: 67}).only({4, 6, 7}) == BlockTrace(
        [4, 6, 7], {1: 65, 2: 67}, {1: 5}
    )


def test_accesses_belong_to_the_block_before_them() -> None:
    def word(number: int, store: int, ahead: int, level: int) -> int:
        return 1 << 30 | number << 5 | store << 4 | ahead << 3 | level

    words = np.array([word(9, 0, 0, 1), 4, word(2, 0, 1, 2), word(3, 1, 0, 1), 5, 6], dtype=np.uint32)
    first, second = Access(2, False, 2, True), Access(3, True, 1, False)
    assert trace_of(words) == BlockTrace([4, 5, 6], accesses={0: [first, second]})


def test_accesses_of_a_block_that_is_left_out_are_of_the_one_before() -> None:
    one, other = Access(0, False, 1, False), Access(1, True, 1, False)
    kept = BlockTrace([4, 5, 6], accesses={1: [one], 2: [other]}).only({4, 6})
    assert kept.accesses == {0: [one], 1: [other]}
