"""Options of an address that are the drivers' own."""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.errors import UsageError, choices, did_you_mean

OPTIONS = ("attitude", "baud", "rate", "system", "texts")
"""``rate`` of the position and ``attitude`` in Hz, ``system`` id; and ``texts=unrecorded`` where the
autopilot records its texts itself, as a simulated one does.
"""


def rate(name: str, options: Mapping[str, str], default: float, *, least: float = 0.0) -> float:
    """Hz."""
    given = options.get(name)
    if given is None:
        return default
    try:
        number = float(given)
    except ValueError:
        number = -1.0
    if not least <= number <= 100.0:
        raise UsageError(f"{name}={given!r} is no rate in Hz from {least:g} to 100")
    return number


def recorded(options: Mapping[str, str]) -> bool:
    """The autopilot's texts are to go into the trace."""
    given = options.get("texts", "recorded")
    if given not in {"recorded", "unrecorded"}:
        raise UsageError(f"texts={given!r}; there is recorded or unrecorded")
    return given == "recorded"


def system(options: Mapping[str, str]) -> int | None:
    """A system id; ``None``: take the first autopilot that speaks."""
    given = options.get("system")
    if given is None:
        return None
    if not given.isdigit() or not 1 <= int(given) <= 255:
        raise UsageError(f"system={given!r} is no system id from 1 to 255")
    return int(given)


def check_options(driver: str, options: Mapping[str, str], *allowed: str) -> None:
    """Refuse options that nobody would look at."""
    for name in options:
        if name not in allowed:
            hint = did_you_mean(name, allowed)
            raise UsageError(f"the {driver} driver has no option {name!r}{hint}; it has {choices(allowed)}")
