import numpy as np

from volery.native.trace import Trace, trace_of


def test_values_of_switches_stand_between_blocks_with_their_sign() -> None:
    value = 1 << 31
    words = np.array([4, value | 65, 5, 6, value | (-3 & 0x7FFFFFFF), 4], dtype=np.uint32)
    assert trace_of(words) == Trace([4, 5, 6, 4], {1: 65, 3: -3})


def test_a_value_stays_before_the_next_block_that_is_followed() -> None:
    assert Trace([4, 5, 6, 7], {1: 65, 2: 66, 3: 67}).only({4, 6, 7}) == Trace(
        [4, 6, 7], {1: 65, 2: 67}, {1: 5}
    )
