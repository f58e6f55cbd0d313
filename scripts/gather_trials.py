"""Flies every conformance check and every fault trial of every simulated autopilot, and keeps what was found.

    python scripts/gather_trials.py [AUTOPILOT ...]

Writes docs/reference/trials.json, from which scripts/generate_docs.py makes two pages and which tests compare
with what they fly themselves. Takes about three minutes. The exit status says whether all is as demanded.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from volery.testing.driver_conformance import conformance
from volery.testing.fault_trials import FAULTS, PHASES, TouchDown, try_fault

AUTOPILOTS = ("ardupilot", "px4", "paparazzi", "dji")
KEPT = Path(__file__).parent.parent / "docs" / "reference" / "trials.json"


def checks(autopilot: str) -> list[dict[str, str]]:
    """What each check found; why, where it did not pass."""
    report = conformance(f"sim:{autopilot}")
    for fault in report.faults:
        print(f"sim:{autopilot}: {fault.check}: {fault.detail}", file=sys.stderr)
    return [
        {
            "check": one.check,
            "outcome": one.outcome.value,
            "why": "" if one.outcome.value == "passed" else one.detail,
        }
        for one in report.results
    ]


def trials(autopilot: str) -> list[dict[str, Any]]:
    """What each fault in each phase came to."""
    found = []
    for fault in FAULTS:
        for phase in PHASES:
            one = try_fault(autopilot, fault, phase)
            if one.broken:
                print(f"sim:{autopilot}: {fault} in {phase}: {one.broken}", file=sys.stderr)
            found.append(
                {
                    "fault": fault,
                    "phase": phase,
                    "caller": one.caller,
                    "aircraft": list(one.aircraft),
                    "ended": one.ended,
                    "landing": _rounded(one.landing),
                    "broken": one.broken,
                }
            )
    return found


def _rounded(landing: TouchDown | None) -> dict[str, float] | None:
    """The touch-down in centimetres, and in thousandths of the battery: a diff shows what matters."""
    if landing is None:
        return None
    return {name: round(value, 3 if name == "battery" else 2) for name, value in asdict(landing).items()}


def main() -> int:
    """Fly them, write the file."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for autopilot in sys.argv[1:] or AUTOPILOTS:
        kept[autopilot] = {"checks": checks(autopilot), "faults": trials(autopilot)}
    ordered = {name: kept[name] for name in AUTOPILOTS if name in kept}
    lines = [f"{json.dumps(name)}: {_lines(found)}" for name, found in ordered.items()]
    KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    broken = [one for found in ordered.values() for one in found["faults"] if one["broken"]]
    failed = [one for found in ordered.values() for one in found["checks"] if one["outcome"] == "failed"]
    return 1 if broken or failed else 0


def _lines(found: dict[str, list[dict[str, Any]]]) -> str:
    """One finding a line: changes are to be read."""
    parts = [
        f" {json.dumps(name)}: [\n" + ",\n".join("  " + json.dumps(one) for one in listed) + "\n ]"
        for name, listed in found.items()
    ]
    return "{\n" + ",\n".join(parts) + "\n}"


if __name__ == "__main__":
    sys.exit(main())
