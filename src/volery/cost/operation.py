"""Figures stated at one frequency, at another one.

Law: the same processor executes the same instructions in the same number of cycles, so time ~ 1/f, and the
energy of an operation ~ V(f)^2 (see ``energy``). Source: the cycle-count view of MARTE's GQAM (``execTime``
over the speed factor of the host). Validity: work bound by the core; memory-bound work gains less from a
higher frequency, so the law is then optimistic upward and pessimistic downward. On another kind of processor
it says nothing: that needs its own figure.
"""

from __future__ import annotations

from volery.base.errors import EstimateError
from volery.base.time import Ns
from volery.cost.energy import PowerLaw


def scale_time(time: Ns, stated: tuple[str, float], wanted: tuple[str, float]) -> Ns:
    """*time* stated at (kind of processor, MHz), at (kind, MHz) *wanted*.

    ``EstimateError`` for another kind.
    """
    _same_kind(stated[0], wanted[0])
    _positive(stated[1], wanted[1])
    return round(time * stated[1] / wanted[1])


def scale_energy(
    joules: float, stated: tuple[str, float], wanted: tuple[str, float], power: PowerLaw
) -> float:
    """*joules* of one operation, scaled like ``scale_time``; *power* is the law of that kind of processor."""
    _same_kind(stated[0], wanted[0])
    _positive(stated[1], wanted[1])
    return joules * power.cycle_ratio(stated[1], wanted[1])


def _same_kind(stated: str, wanted: str) -> None:
    if stated != wanted:
        raise EstimateError(
            f"a figure stated for {stated} says nothing about {wanted}: state one for {wanted} as well"
        )


def _positive(*frequencies_mhz: float) -> None:
    for frequency in frequencies_mhz:
        if not frequency > 0.0:
            raise EstimateError(f"a frequency of {frequency:g} MHz: state one above zero")
