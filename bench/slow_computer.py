"""What a slow computer, or one that is busy with something else, does to a landing.

The pocket scenario of the delivery example: one parcel, one flight, a precision landing that wants a picture
worked on each 100 ms. The computer on board of the drone runs at 1500 or at 600 MHz, alone or with something
else that takes a share of its four cores. Everything else is the same. Each row is of the same eight seeds,
that is, of the same eight winds.

    python bench/slow_computer.py [--seeds 8]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from statistics import mean

from volery import Options, simulate
from volery.requirements.record import RunRecord

DELIVERY = Path(__file__).parents[1] / "examples" / "delivery"
LOAD = "platform.processors.onboard_1.load={} %"
CASES = (("fast", 0), ("slow", 0), ("fast", 80), ("slow", 80), ("fast", 90), ("slow", 90))
FIRST_SEED = 7


def flown(allocation: str, load: int, seed: int) -> RunRecord:
    overrides = (LOAD.format(load),) if load else ()
    options = Options(fidelity="code", seed=seed)
    return simulate(DELIVERY, options, scenario="pocket", allocation=allocation, overrides=overrides).record


def late(records: Sequence[RunRecord], component: str) -> str:
    """The share of its activations that missed their deadlines, over all runs."""
    counted = [record.components[component] for record in records]
    return f"{sum(one.deadline_misses for one in counted) / sum(one.activations for one in counted):.0%}"


def row(records: Sequence[RunRecord], load: int) -> tuple[str, ...]:
    offsets = [record.requirements["landing_offset_1"].observed for record in records]
    landed = [one for one in offsets if one is not None]
    failed = Counter(name for record in records for name, one in record.requirements.items() if not one.met)
    longest = max(record.components["landing_1"].response_s.max or 0.0 for record in records)
    return (
        f"{records[0].processors['onboard_1'].frequency_mhz:.0f} MHz",
        f"{load} %",
        f"{mean(record.processors['onboard_1'].utilisation for record in records):.0%}",
        f"{1e3 * longest:.0f} ms",
        late(records, "landing_1"),
        late(records, "drone_control_1"),
        f"{mean(landed):.2f} m, up to {max(landed):.2f} m" if landed else "-",
        ", ".join(f"{name} ({count})" for name, count in failed.items()) or "none",
    )


HEADINGS = (
    "on board",
    "load",
    "busy",
    "longest picture",
    "pictures late",
    "control late",
    "landing offset",
    "requirements that fail (in so many runs)",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=8, help="runs of each case")
    seeds = range(FIRST_SEED, FIRST_SEED + parser.parse_args().seeds)
    print("| " + " | ".join(HEADINGS) + " |")
    print("|" + "---|" * len(HEADINGS))
    with ProcessPoolExecutor() as pool:
        runs = {case: [pool.submit(flown, *case, seed) for seed in seeds] for case in CASES}
        for (_, load), waiting in runs.items():
            print("| " + " | ".join(row([one.result() for one in waiting], load)) + " |", flush=True)


if __name__ == "__main__":
    main()
