"""What a slow computer, or one that is busy with something else, does to a landing.

The pocket scenario of the delivery example: one parcel, one flight, a precision landing that wants a picture
worked on each 100 ms. The computer on board of the drone runs at 1500 or at 600 MHz, alone or with something
else that takes a share of its four cores. Everything else is the same, the seed as well.

    python bench/slow_computer.py
"""

from __future__ import annotations

from pathlib import Path

from volery import Options, simulate
from volery.requirements.record import RunRecord

DELIVERY = Path(__file__).parents[1] / "examples" / "delivery"
LOAD = "platform.processors.onboard_1.load={} %"
CASES = (("fast", 0), ("slow", 0), ("fast", 80), ("slow", 80), ("fast", 90), ("slow", 90))
SEED = 7


def flown(allocation: str, load: int) -> RunRecord:
    overrides = (LOAD.format(load),) if load else ()
    options = Options(fidelity="code", seed=SEED)
    return simulate(DELIVERY, options, scenario="pocket", allocation=allocation, overrides=overrides).record


def row(record: RunRecord, load: int) -> tuple[str, ...]:
    onboard, landing = record.processors["onboard_1"], record.components["landing_1"]
    control = record.components["drone_control_1"]
    offset = record.requirements["landing_offset_1"].observed
    failed = [name for name, one in record.requirements.items() if not one.met]
    return (
        f"{onboard.frequency_mhz:.0f} MHz",
        f"{load} %",
        f"{100 * onboard.utilisation:.0f} %",
        f"{1e3 * (landing.response_s.max or 0):.0f} ms",
        f"{landing.deadline_misses} of {landing.activations}",
        f"{control.deadline_misses} of {control.activations}",
        "-" if offset is None else f"{offset:.2f} m",
        ", ".join(failed) or "none",
    )


HEADINGS = (
    "on board",
    "load",
    "busy",
    "longest picture",
    "pictures late",
    "control late",
    "landing offset",
    "requirements that fail",
)


def main() -> None:
    print("| " + " | ".join(HEADINGS) + " |")
    print("|" + "---|" * len(HEADINGS))
    for allocation, load in CASES:
        print("| " + " | ".join(row(flown(allocation, load), load)) + " |", flush=True)


if __name__ == "__main__":
    main()
