"""Quantities with units as text: ``2 ms``, ``57600 bit/s``, ``5 Ah``, ``0.5 %``, ``6 / h``, ``30 deg``.

A table of its own instead of a units library: it has only the units that a model needs, so a typo is refused
and not read as one of hundreds, and its rational arithmetic is exact, so a time is the nanosecond that was
written. Angles are a dimension of their own.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from volery.base.errors import did_you_mean
from volery.base.time import Ns, S

BASES = ("s", "m", "kg", "A", "bit", "rad")
Dimension = tuple[int, int, int, int, int, int]
"""Exponents of second, metre, kilogram, ampere, bit and radian."""

PLAIN: Dimension = (0, 0, 0, 0, 0, 0)

_NUMBER = re.compile(r"\s*([-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?)\s*(.*?)\s*\Z", re.DOTALL)
_FACTOR = re.compile(r"\s*([*/·]?)\s*([A-Za-zµμΩ%°]+|1)(?:\^?(-?\d))?\s*")
_PREFIXES = {
    "n": Fraction(1, 10**9),
    "u": Fraction(1, 10**6),
    "m": Fraction(1, 10**3),
    "c": Fraction(1, 10**2),
    "": Fraction(1),
    "k": Fraction(10**3),
    "M": Fraction(10**6),
    "G": Fraction(10**9),
}
_DEGREE = Fraction(math.pi) / 180


class QuantityError(ValueError):
    """A text is no quantity, or not of the expected kind. The message has a valid example."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Value in SI units, exact if it was written exactly."""

    value: Fraction
    dimension: Dimension


@dataclass(frozen=True, slots=True)
class Kind:
    """Kind of quantity. ``unit`` is the SI unit of its values."""

    noun: str
    unit: str
    examples: str

    @property
    def dimension(self) -> Dimension:
        """Dimension of a quantity of this kind."""
        return unit(self.unit).dimension


def _table() -> dict[str, Quantity]:
    dimensions: dict[str, tuple[str, Fraction, Dimension]] = {
        "s": ("n u m", Fraction(1), (1, 0, 0, 0, 0, 0)),
        "Hz": ("k M G", Fraction(1), (-1, 0, 0, 0, 0, 0)),
        "m": ("m c k", Fraction(1), (0, 1, 0, 0, 0, 0)),
        "g": ("k", Fraction(1, 1000), (0, 0, 1, 0, 0, 0)),
        "N": ("", Fraction(1), (-2, 1, 1, 0, 0, 0)),
        "J": ("n u m k", Fraction(1), (-2, 2, 1, 0, 0, 0)),
        "Wh": ("m k", Fraction(3600), (-2, 2, 1, 0, 0, 0)),
        "W": ("u m k", Fraction(1), (-3, 2, 1, 0, 0, 0)),
        "A": ("u m", Fraction(1), (0, 0, 0, 1, 0, 0)),
        "Ah": ("m", Fraction(3600), (1, 0, 0, 1, 0, 0)),
        "C": ("", Fraction(1), (1, 0, 0, 1, 0, 0)),
        "V": ("m", Fraction(1), (-3, 2, 1, -1, 0, 0)),
        "Ohm": ("m k", Fraction(1), (-3, 2, 1, -2, 0, 0)),
        "Ω": ("m k", Fraction(1), (-3, 2, 1, -2, 0, 0)),
        "bit": ("k M G", Fraction(1), (0, 0, 0, 0, 1, 0)),
        "B": ("k M G", Fraction(8), (0, 0, 0, 0, 1, 0)),
        "rad": ("m", Fraction(1), (0, 0, 0, 0, 0, 1)),
    }
    table = {
        prefix + name: Quantity(factor * _PREFIXES[prefix], dimension)
        for name, (prefixes, factor, dimension) in dimensions.items()
        for prefix in ["", *prefixes.split()]
    }
    second = table["s"].dimension
    table |= {name: Quantity(Fraction(n), second) for name, n in (("min", 60), ("h", 3600), ("d", 86400))}
    table |= {name: Quantity(_DEGREE, table["rad"].dimension) for name in ("deg", "°")}
    table["%"] = Quantity(Fraction(1, 100), PLAIN)
    table["1"] = Quantity(Fraction(1), PLAIN)
    micro = {sign + name[1:]: table[name] for name in table if name[0] == "u" for sign in "µμ"}
    return table | micro


UNITS = _table()
"""Every valid unit symbol, with its size in SI units."""

TIME = Kind("time", "s", "2 ms, 1.5 s or 15 min")
FREQUENCY = Kind("frequency", "Hz", "1500 MHz or 1.5 GHz")
RATE = Kind("rate", "Hz", "6 / h or 0.1 Hz")
LENGTH = Kind("length", "m", "0.3 m, 30 cm or 1.2 km")
SPEED = Kind("speed", "m/s", "3 m/s or 18 km/h")
ANGLE = Kind("angle", "deg", "30 deg or 0.5 rad")
TURN_RATE = Kind("turn rate", "deg/s", "2 deg/min or 0.1 rad/s")
ACCELERATION = Kind("acceleration", "m/s^2", "0.3 m/s^2")
ENERGY = Kind("energy", "J", "3 mJ or 0.2 Wh")
CHARGE = Kind("battery capacity", "C", "5 Ah or 5200 mAh")
POWER = Kind("power", "W", "2.7 W or 300 mW")
VOLTAGE = Kind("voltage", "V", "14.8 V")
BANDWIDTH = Kind("bandwidth", "bit/s", "57600 bit/s or 20 Mbit/s")
DATA_SIZE = Kind("size", "B", "96 B or 12 kB")
MASS = Kind("mass", "kg", "2.4 kg or 350 g")
FORCE = Kind("force", "N", "12 N")
AREA = Kind("area", "m^2", "0.05 m^2")
RESISTANCE = Kind("resistance", "Ohm", "12 mOhm")
RATIO = Kind("ratio", "1", "0.5 % or 0.005")
KINDS = (
    TIME, FREQUENCY, LENGTH, SPEED, ANGLE, TURN_RATE, ACCELERATION, ENERGY, POWER, CHARGE, VOLTAGE, BANDWIDTH,
    DATA_SIZE, MASS, FORCE, AREA, RESISTANCE, RATIO,
)  # fmt: skip


def unit(text: str) -> Quantity:
    """Return the size of a unit such as ``m/s``, ``/ h`` or ``bit/s``; an empty text is the number one."""
    size, exponents, position = Fraction(1), list(PLAIN), 0
    while position < len(text):
        factor = _FACTOR.match(text, position)
        if factor is None or (position > 0 and not factor.group(1)):
            raise QuantityError(f"{text!r} is not a unit")
        sign = (-1 if factor.group(1) == "/" else 1) * int(factor.group(3) or 1)
        symbol = _symbol(factor.group(2))
        size *= symbol.value**sign
        exponents = [e + sign * d for e, d in zip(exponents, symbol.dimension, strict=True)]
        position = factor.end()
    s, m, kg, a, bit, rad = exponents
    return Quantity(size, (s, m, kg, a, bit, rad))


def _symbol(name: str) -> Quantity:
    if name not in UNITS:
        raise QuantityError(f"there is no unit {name!r}{did_you_mean(name, UNITS)}")
    return UNITS[name]


def parse(text: str) -> Quantity:
    """Parse a number with its unit. Raises ``QuantityError``."""
    split = _NUMBER.match(text)
    if split is None:
        raise QuantityError(f"{text!r} is not a number with a unit")
    size = unit(split.group(2))
    return Quantity(Fraction(split.group(1).replace("_", "")) * size.value, size.dimension)


def read(written: object, kind: Kind) -> float:
    """Return a quantity in the SI unit of its kind.

    Args:
        written: A text, or a number for a ratio, a count or zero.
        kind: The expected kind.

    Raises:
        QuantityError: *written* is not of that kind.
    """
    try:
        return float(_exact(written, kind) / unit(kind.unit).value)
    except OverflowError:
        raise QuantityError(f"{written!r} is too large") from None


def read_ns(written: object) -> Ns:
    """Return a time to the nearest nanosecond. Raises ``QuantityError``."""
    return round(_exact(written, TIME) * S)


def _exact(written: object, kind: Kind) -> Fraction:
    expected = f"{_article(kind.noun)} such as {kind.examples} is expected"
    if isinstance(written, bool) or not isinstance(written, int | float | str):
        raise QuantityError(f"{expected}, not {written!r}")
    try:
        quantity = parse(written) if isinstance(written, str) else _bare(written)
    except QuantityError as error:
        raise QuantityError(f"{error}; {expected}") from None
    if quantity.dimension != kind.dimension and not (quantity.value == 0 and quantity.dimension == PLAIN):
        raise QuantityError(f"{str(written)!r} is {describe(quantity.dimension)}; {expected}")
    return quantity.value


def _bare(number: float) -> Quantity:
    if not math.isfinite(number):
        raise QuantityError(f"{number} is not finite")
    return Quantity(Fraction(number), PLAIN)


def describe(dimension: Dimension) -> str:
    """Describe a dimension in a message: ``a length``, ``a number without a unit``, ``in m/s^2``."""
    if dimension == PLAIN:
        return "a number without a unit"
    for kind in KINDS:
        if kind.dimension == dimension:
            return _article(kind.noun)
    powers = [
        name if exponent == 1 else f"{name}^{exponent}"
        for name, exponent in zip(BASES, dimension, strict=True)
        if exponent
    ]
    return "in " + " ".join(powers)


def _article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
