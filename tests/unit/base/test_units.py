"""Quantities as people write them."""

import pytest

from volery.base import units
from volery.base.units import QuantityError, parse, read, read_ns


@pytest.mark.parametrize(
    ("written", "kind", "value"),
    [
        ("57600 bit/s", units.BANDWIDTH, 57600.0),
        ("20 Mbit/s", units.BANDWIDTH, 20e6),
        ("1 kB/s", units.BANDWIDTH, 8000.0),
        ("1.5 GHz", units.FREQUENCY, 1.5e9),
        ("5 Ah", units.CHARGE, 18000.0),
        ("5200 mAh", units.CHARGE, 18720.0),
        ("0.5 %", units.RATIO, 0.005),
        (0.005, units.RATIO, 0.005),
        ("6 / h", units.RATE, 6 / 3600),
        ("6/h", units.RATE, 6 / 3600),
        ("18 km/h", units.SPEED, 5.0),
        ("30 deg", units.ANGLE, 30.0),
        ("30 °", units.ANGLE, 30.0),
        ("3 mJ", units.ENERGY, 0.003),
        ("2 W*s", units.ENERGY, 2.0),
        ("1 N m", units.ENERGY, None),
        ("1e3 m", units.LENGTH, 1000.0),
        (".5 m", units.LENGTH, 0.5),
        ("1_000 m", units.LENGTH, 1000.0),
        ("-3 m", units.LENGTH, -3.0),
        (0, units.LENGTH, 0.0),
        ("0", units.TIME, 0.0),
    ],
)
def test_reading(written, kind, value):
    if value is None:
        with pytest.raises(QuantityError, match="is not a unit"):
            read(written, kind)
    else:
        assert read(written, kind) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("written", "ns"),
    [
        ("2 ms", 2_000_000),
        ("0.1 us", 100),
        ("0.1 µs", 100),
        ("15 min", 900_000_000_000),
        ("1.5 s", 1_500_000_000),
    ],
)
def test_times_are_exact_nanoseconds(written, ns):
    assert read_ns(written) == ns


@pytest.mark.parametrize(
    ("written", "pieces"),
    [
        ("2 kg", ["'2 kg' is a mass", "a time such as 2 ms, 1.5 s or 15 min is expected"]),
        ("3 m", ["'3 m' is a length", "a time such as"]),
        (5, ["'5' is a number without a unit", "a time such as"]),
        ("soon", ["'soon' is not a number with a unit"]),
        ("3 mss", ["there is no unit 'mss' (did you mean 'ms'?)"]),
        ("3 m s", ["'m s' is not a unit"]),
        ("3 s!", ["is not a unit"]),
        (True, ["not True"]),
        (None, ["not None"]),
        ([1], ["not [1]"]),
        (float("nan"), ["nan is not finite"]),
        (float("inf"), ["inf is not finite"]),
        ("1e999 s", ["is not a unit"]),
        ("3 Ms", ["there is no unit 'Ms'"]),
        ("3 m/s^3", ["is in s^-3 m"]),
    ],
)
def test_what_is_refused(written, pieces):
    with pytest.raises(QuantityError) as caught:
        read(written, units.TIME)
    for piece in pieces:
        assert piece in str(caught.value)


def test_a_plain_number_is_a_quantity():
    assert parse("5").dimension == units.PLAIN
