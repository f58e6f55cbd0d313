"""How durations are spread, in bounded memory and exactly the same on every machine.

Integer nanoseconds fall into buckets that keep the ten leading bits, the idea of HdrHistogram
(https://hdrhistogram.org): mean, count and maximum are exact, a quantile is at most 0.2 % too high and never
too low.
"""

from __future__ import annotations

from volery.base.time import Ns

_BITS = 10


class Distribution:
    """Count, mean, maximum and quantiles of non-negative durations."""

    def __init__(self) -> None:
        self.count = 0
        self.total: Ns = 0
        self.largest: Ns = 0
        self._buckets: dict[int, int] = {}

    def add(self, duration: Ns) -> None:
        """One more observation."""
        value = max(0, duration)
        self.count += 1
        self.total += value
        self.largest = max(self.largest, value)
        shift = max(0, value.bit_length() - _BITS)
        bucket = (shift << _BITS) + (value >> shift)
        self._buckets[bucket] = self._buckets.get(bucket, 0) + 1

    def mean(self) -> float | None:
        """Nanoseconds; ``None`` if nothing was observed."""
        return self.total / self.count if self.count else None

    def quantile(self, share: float) -> Ns | None:
        """The smallest duration that *share* (0..1) of all do not exceed; ``None`` if there are none."""
        if not self.count:
            return None
        wanted = share * self.count
        seen = 0
        for bucket in sorted(self._buckets):
            seen += self._buckets[bucket]
            if seen >= wanted:
                return min(_upper_edge(bucket), self.largest)
        return self.largest


def _upper_edge(bucket: int) -> Ns:
    shift, leading = bucket >> _BITS, bucket & ((1 << _BITS) - 1)
    return ((leading + 1) << shift) - 1
