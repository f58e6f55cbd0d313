"""From costs to an entry of the catalogue, in a file of the user's.

A campaign knows one frequency: its law holds there only. The law of a second campaign at another frequency
joins it to lines over the frequency, as in the paper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from volery.calibration.catalogue_file import put_law
from volery.calibration.machine import Machine
from volery.calibration.ros.campaign import Circumstances
from volery.calibration.ros.fitting import Cost, Straight
from volery.cost.catalogue import read_file
from volery.cost.figure import Line, through
from volery.cost.ros import CallFigures, RosLaw

CALLBACK = ("spin_once_first", "spin_once_next")
"""What the embedded graph prices when a callback begins."""

_UNITS = {
    "publish": "subscriber",
    "publish_next": "subscriber",
    "sleep": "microsecond slept",
    "wait": "microsecond",
}


def law_of(costs: Mapping[str, Cost], under: Circumstances) -> RosLaw:
    """The law that holds at the frequency of one campaign."""
    calls = {call: _figures(cost) for call, cost in _with_slope(costs).items()}
    if CALLBACK[1] not in calls and "receive" in calls:  # rospy: its threads call back as messages come
        received = calls.pop("receive").model_copy(
            update={"note": "rospy has no spinOnce: this is what a message takes until its callback begins"}
        )
        calls.update(dict.fromkeys(CALLBACK, received))
    rounds = max((len(values) for cost in costs.values() for values in cost.points.values()), default=0)
    return RosLaw(
        client=under.client,
        provenance="measured",
        source=f"volery calibrate ros --client {under.client}, {rounds} rounds on {under.processor}",
        validity=f"{under.frequency_mhz:g} MHz only; publishers with a queue (queue_size above 0)",
        error=round(max((cost.spread / 2.0 for cost in _common(costs)), default=0.0), 3),
        least_mhz=under.frequency_mhz,
        greatest_mhz=under.frequency_mhz,
        calls=calls,
    )


def _with_slope(costs: Mapping[str, Cost]) -> dict[str, Cost]:
    """``publish_next`` is measured at one number of subscribers: what each adds is what it adds elsewhere."""
    first, following = costs.get("publish"), costs.get("publish_next")
    if first is None or following is None or following.typical <= 0.0:
        return {call: cost for call, cost in costs.items() if call != "publish_next"}
    [x] = following.points
    whole, caller = (
        _through_point(x, getattr(following, part).at(x), getattr(first, part).per_x)
        for part in ("whole", "caller")
    )
    return {**costs, "publish_next": replace(following, whole=whole, caller=caller)}


def _through_point(x: float, value: float, per_x: float) -> Straight:
    per_x = min(per_x, value / x)
    return Straight(value - per_x * x, per_x)


def _common(costs: Mapping[str, Cost]) -> list[Cost]:
    """What a node does again and again, by which a law as a whole is judged."""
    return [costs[call] for call in ("publish", "sleep") if call in costs]


def _figures(cost: Cost) -> CallFigures:
    unit = _UNITS.get(cost.call)
    spread = f"half the inter-quartile range {cost.spread / 2.0:.0%}"
    residual = f", medians at most {cost.residual:.0%} off the line" if unit else ""
    return CallFigures(
        provenance="measured",
        source=f"{cost.count} measurements, {spread}{residual}",
        constant=_line(cost.whole.constant),
        per_x=_line(cost.whole.per_x) if unit else None,
        caller=_line(cost.caller.constant),
        caller_per_x=_line(cost.caller.per_x) if unit else None,
        error=round(cost.spread / 2.0, 3),
    )


def _line(value: float) -> Line:
    return Line(offset=float(f"{value:.6g}"))


def joined(known: RosLaw, new: RosLaw) -> RosLaw:
    """Two laws of one frequency each become one between them; otherwise *new* stands alone."""
    low, high = sorted((known, new), key=lambda law: law.least_mhz)
    one_point = known.least_mhz == known.greatest_mhz
    if not one_point or low.least_mhz == high.least_mhz:
        return new
    calls = {
        call: _through(low.least_mhz, low.calls[call], high.least_mhz, high.calls[call])
        for call in low.calls
        if call in high.calls
    }
    between = f"{low.least_mhz:g} to {high.least_mhz:g} MHz"
    return new.model_copy(
        update={
            "calls": calls,
            "least_mhz": low.least_mhz,
            "greatest_mhz": high.least_mhz,
            "error": max(low.error, high.error),
            "validity": new.validity.replace(f"{new.least_mhz:g} MHz only", between),
        }
    )


def _through(at_low: float, low: CallFigures, at_high: float, high: CallFigures) -> CallFigures:
    def line(name: str) -> Line | None:
        one, other = getattr(low, name), getattr(high, name)
        if one is None or other is None:
            return None
        return through({at_low: one.offset, at_high: other.offset})

    parts = ("constant", "per_x", "caller", "caller_per_x")
    errors = [one.error or 0.0 for one in (low, high)]
    return high.model_copy(update={**{name: line(name) for name in parts}, "error": max(errors)})


def write_entry(file: Path, machine: Machine, law: RosLaw) -> RosLaw:
    """Put *law* into the catalogue at *file*, made if need be, in place of what it has of this library.

    Returns the law that stands there now. ``ModelError`` if the file is there and no catalogue,
    ``UsageError`` if it cannot be written.
    """
    known = read_file(file).processors.get(machine.name) if file.exists() else None
    before = known.ros.get(law.client) if known is not None else None
    made = joined(before, law) if before is not None else law
    put_law(file, machine, ("ros", law.client), made, (made.least_mhz, made.greatest_mhz))
    return made


def in_figures(line: Straight, call: str) -> str:
    """Microseconds, and what each subscriber (n) or millisecond adds."""
    unit = _UNITS.get(call)
    if unit is None:
        return f"{line.constant / 1e3:.1f}"
    constant = f"{line.constant / 1e3:.1f} + " if line.constant else ""
    if unit == "subscriber":
        return f"{constant}{line.per_x / 1e3:.1f} n"
    return f"{constant}{line.per_x:.3f} ms"
