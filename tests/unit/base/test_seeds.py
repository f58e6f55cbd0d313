from __future__ import annotations

from volery.base.seeds import key, stream


def test_a_stream_depends_on_seed_and_name_only() -> None:
    draws = [stream(7, "radio").random() for _ in range(2)]
    assert draws[0] == draws[1]
    assert stream(7, "gps").random() != draws[0]
    assert stream(8, "radio").random() != draws[0]


def test_streams_do_not_change_from_one_version_to_the_next() -> None:
    """Recorded runs can be repeated later: these figures are for ever."""
    drawn = stream(7, "radio")
    assert [drawn.getrandbits(32) for _ in range(3)] == [1889162060, 1970469915, 3377954199]
    assert key(7, "drone_1/gps") == 13550935541503017529
    assert drawn.random() == 0.7922709842050519


def test_a_key_has_64_bits() -> None:
    keys = [key(seed, "gps") for seed in range(200)]
    assert len(set(keys)) == 200
    assert all(0 <= each < 2**64 for each in keys)
    assert max(keys) > 2**63


def test_seed_and_name_do_not_run_into_each_other() -> None:
    assert key(1, "1/x") != key(11, "x")
    assert key(1, "x") != key(-1, "x")
