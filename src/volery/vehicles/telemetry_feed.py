"""Telemetry over time: callbacks on changes, and a history for plots and tables."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import isnan
from typing import Any, Literal, NamedTuple

from volery.base.data_frames import to_frame
from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.position import Position
from volery.base.time import Ns, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.vehicles.telemetry import Telemetry

Quantity = Literal[
    "position",
    "altitude",
    "velocity",
    "attitude",
    "battery",
    "mode",
    "armed",
    "home",
    "satellites",
    "fix",
    "text",
]

_READ: Mapping[str, Callable[[Telemetry], Any]] = {
    "position": lambda seen: seen.position,
    "altitude": lambda seen: seen.above_home,
    "velocity": lambda seen: seen.velocity,
    "attitude": lambda seen: seen.attitude,
    "battery": lambda seen: seen.battery,
    "mode": lambda seen: seen.mode,
    "armed": lambda seen: seen.armed,
    "home": lambda seen: seen.home,
    "satellites": lambda seen: seen.satellites,
    "fix": lambda seen: seen.fix,
    "text": lambda seen: seen.texts[-1] if seen.texts else None,
}


def read_quantity(telemetry: Telemetry, quantity: str) -> Any:
    """Return the present value of a quantity; raise ``UsageError`` for a name that there is not."""
    read = _READ.get(quantity) if isinstance(quantity, str) else None
    if read is None:
        hint = did_you_mean(str(quantity), _READ)
        raise UsageError(f"no quantity {quantity!r}{hint}; there is {choices(_READ)}")
    return read(telemetry)


def _is_known(value: Any) -> bool:
    """Return whether a value was reported: neither ``None`` nor NaN, and no tuple of NaN alone."""
    if isinstance(value, tuple):
        return any(_is_known(part) for part in value)
    return value is not None and not (isinstance(value, float) and isnan(value))


def subscribe(
    kernel: Kernel, telemetry: Telemetry, quantity: str, callback: Callable[[Any], object], period: Ns
) -> Handle:
    """Call *callback* each *period* ns in which the quantity has changed; at first with its present value."""
    read_quantity(telemetry, quantity)
    read = _READ[quantity]
    last: list[Any] = [None]

    def check() -> None:
        value = read(telemetry)
        if _is_known(value) and value != last[0]:
            last[0] = value
            callback(value)

    with kernel.guard:
        return kernel.every(period, check)


class TelemetrySample(NamedTuple):
    """The values of one moment, by quantity."""

    at: Ns
    values: tuple[Any, ...]


class TelemetryHistory:
    """Quantities of one vehicle over time; it grows until ``stop()`` or the end of the program.

    Args:
        kernel: clock.
        telemetry: telemetry of the vehicle.
        quantities: what is recorded.
        period: time between two samples, ns.
        keep: age up to which samples are kept, ns.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, quantities: Sequence[str], period: Ns, keep: Ns
    ) -> None:
        self.quantities = tuple(quantities)
        self._kernel = kernel
        self._telemetry = telemetry
        self._samples: deque[TelemetrySample] = deque(maxlen=max(1, keep // period))
        with kernel.guard:
            self._handle = kernel.every(period, self._sample)

    def _sample(self) -> None:
        values = tuple(_READ[quantity](self._telemetry) for quantity in self.quantities)
        self._samples.append(TelemetrySample(self._kernel.now(), values))

    def stop(self) -> None:
        """Record nothing more; what was recorded stays."""
        with self._kernel.guard:
            self._handle.cancel()

    @property
    def samples(self) -> list[TelemetrySample]:
        """What was recorded, oldest first; times are ns since the start of the run."""
        with self._kernel.guard:
            return list(self._samples)

    def columns(self) -> dict[str, list[Any]]:
        """Return columns by name: ``time_s``, and ``velocity_north``, ``position_latitude`` and so on."""
        rows = [{"time_s": to_seconds(sample.at), **self._flat(sample)} for sample in self.samples]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def _flat(self, sample: TelemetrySample) -> dict[str, Any]:
        row: dict[str, Any] = {}
        for quantity, value in zip(self.quantities, sample.values, strict=True):
            if isinstance(value, Position):
                row[f"{quantity}_latitude"], row[f"{quantity}_longitude"] = value.latitude, value.longitude
                row[f"{quantity}_amsl"] = value.altitude.metres
            elif hasattr(value, "_asdict"):
                row |= {f"{quantity}_{name}": part for name, part in value._asdict().items()}
            elif value is not None:
                row[quantity] = value
        return row

    def to_pandas(self) -> Any:
        """Return the columns as a ``pandas.DataFrame`` with the index ``time_s``."""
        return to_frame(self.columns(), "time_s")
