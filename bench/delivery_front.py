"""The front of the delivery service: energy of its computers, delivery time, price of its hardware.

    python bench/delivery_front.py [--workers 2] [--repetitions 10] [--budget 32] [--out FOLDER]

Two orders in the pocket city, by 1 to 4 drones, on three computers (ground, on board of drones, on board of
rovers) with frequencies and an allocation each. Every variant that the analysis does not discard is run once,
which gives the exact front. Search and random sampling then take their rows from these runs: the same design
and seed is the same row. A folder that is given again continues where it was interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from volery.explore.campaign import CampaignRequest, prepare
from volery.explore.points import CampaignRow, Value, VariantPoint
from volery.explore.search import (
    Front,
    Objective,
    analysis_discards,
    front_of,
    hardware_cost,
    hypervolume,
    search,
)
from volery.explore.space import Choices
from volery.explore.statistics import mean
from volery.model.text import parse

DELIVERY = Path(__file__).parents[1] / "examples" / "delivery"
PADS_EAST_M = (-3, 3, 9, -9)
SEED = 7
PI = "rpi4-cortex-a72"
ROVERS = ", ".join(f"platform.processors.onboard_{one}.frequency" for one in ("depot", "north", "east"))
SPACE = {
    "allocation": Choices(["station", "board", "rover"]),
    "platform.processors.onboard.frequency": Choices(["600 MHz", "800 MHz", "1000 MHz", "1500 MHz"]),
    ROVERS: Choices(["600 MHz", "1500 MHz"]),
    "environment.vehicles.drone.count": Choices([1, 2, 3, 4]),
}
CONSTRAINTS = ("delivered", "delivery_time", "landing_in_time_1", "control_in_time_1", "battery_1")
"""Those of the first drone, which each variant has; the others have the same computer."""
Known = Callable[[Mapping[str, Value]], Any]


def model() -> dict[str, Any]:
    """Return the delivery example in the pocket city, with one entry for a number of drones."""
    tree: dict[str, Any] = parse((DELIVERY / "model.yaml").read_text(), "model.yaml").plain()
    application, environment = tree["application"], tree["environment"]
    for name in ("drone_control", "landing"):
        del application[f"{name}_1"], application[f"{name}_2"]
    application["central"]["drones"] = "drone_control.service"
    drone = {"drone": "drone", "city": "environment"}
    application["drone_control"] = {"is": "DroneControl", "landing": "landing.service", **drone}
    application["landing"] = {"is": "PrecisionLanding", "drone": "drone", "beacon": "beacon.light"}
    around = environment["components"]
    del around["beacon_1"], around["beacon_2"]
    around["beacon"] = {"is": "LandingBeacon", "body": "drone", "city": "environment"}
    for number, east in enumerate(PADS_EAST_M, 1):
        application[f"drone_control_{number}"] = {"parameters": {"pad_east_m": east}}
        around[f"beacon_{number}"] = {"parameters": {"pad_east_m": east}}
    vehicles = environment["vehicles"]
    del vehicles["drone_1"], vehicles["drone_2"]
    pads = [{"east": f"{east} m", "north": "0 m"} for east in PADS_EAST_M]
    vehicles["drone"] = {
        "count": 2, "kind": "multirotor", "autopilot": "ardupilot", "at": pads, "battery": "10 Ah",
    }  # fmt: skip
    environment["world"] = "pocket.yaml"
    environment["workload"] = {"requesters": 1, "orders": {"first": "1 s", "rate": "1 / s", "count": 2}}
    processors = tree["platform"]["processors"]
    onboard = processors.pop("onboard_1")
    del processors["onboard_2"]
    processors["onboard"] = {**onboard, "carried_by": "drone", "powered_by": "drone"}
    tree["platform"]["networks"]["radio"]["between"] = list(processors)
    central = tree["components"]["DeliveryCentral"]
    central["parameters"].update(handling_s=0.5, poll_s=0.25)
    # The station's figures, times 4 on a Raspberry Pi.
    for kind, key, times in (
        (central, "activation", {"": 1.2}),
        (central, "operations", {"order": 0.8}),
        (tree["components"]["RouteGenerator"], "operations", {"get_route": 4.0}),
    ):
        for operation, time in times.items():
            place = kind[key] if operation else kind
            here = {"time": f"{time} ms", "at": {"processor": PI, "frequency": "1500 MHz"}}
            place[operation or key] = [place[operation or key], here]
    fixed = {
        name: where
        for name, where in tree["allocations"]["fast"].items()
        if not name.endswith(("_1", "_2")) and name not in ("central", "planner")
    }
    fixed.update(drone_control="onboard", landing="onboard", drone="onboard")
    small = {"platform.processors.ground": {"is": PI, "frequency": "1500 MHz"}}
    tree["allocations"] = {
        "station": {**fixed, "central": "ground", "planner": "ground"},
        "board": {**fixed, "central": "ground", "planner": "ground", "set": small},
        "rover": {**fixed, "central": "onboard_depot", "planner": "onboard_depot", "set": small},
    }
    del tree["scenarios"]
    tree["requirements"] = {
        "delivered": {"observe": "application.delivered", "min": 2},
        "delivery_time": {"observe": "application.delivery_time_max", "max": "3 min"},
        "landing_in_time": {"observe": "landing.deadline_misses", "max": 0},
        "control_in_time": {"observe": "drone_control.response_time", "max": "100 ms"},
        "battery": {"observe": "drone.battery_min", "min": 0.2},
    }
    tree["run"] = {"duration": "3 min", "until": {"observe": "application.delivered", "min": 2}}
    return tree


def remembered(function: Known) -> Known:
    """Return *function* of a variant, computed once for each."""
    known: dict[str, Any] = {}

    def of(values: Mapping[str, Value]) -> Any:
        key = VariantPoint(values).variant
        if key not in known:
            known[key] = function(values)
        return known[key]

    return of


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--repetitions", type=int, default=10)
    options.add_argument("--budget", type=int, default=32)
    options.add_argument("--out", type=Path)
    chosen = options.parse_args()
    with TemporaryDirectory() as temporary:
        measure(chosen, chosen.out or Path(temporary))


def measure(chosen: argparse.Namespace, out: Path) -> None:
    """Run the campaign below *out* and print its figures."""
    source = out / "model"
    source.mkdir(parents=True, exist_ok=True)
    for name in ("components", "pocket.yaml"):
        if not (source / name).exists():
            (source / name).symlink_to(DELIVERY / name)
    path = source / "model.yaml"
    path.write_text(json.dumps({**model(), "files_from": os.path.relpath(DELIVERY, source)}))
    request = CampaignRequest.of(
        path, out / "campaign", SPACE, seeds=1, fidelity="times", workers=chosen.workers
    )
    with prepare(request) as campaign:
        of_price = hardware_cost(str(path), "USD")
        price = remembered(lambda values: of_price.value(CampaignRow(0, VariantPoint(values))))
        objectives = [
            Objective("application.computing_energy"),
            Objective("application.delivery_time_max"),
            Objective("hardware_price", measure=lambda row: price(row.point.values)),
        ]
        discard = remembered(analysis_discards(str(path), "times"))

        def evaluate(points: Sequence[VariantPoint]) -> list[CampaignRow]:
            rows = campaign.evaluate([VariantPoint(one.values, SEED) for one in points])
            return [replace(row, point=one) for row, one in zip(rows, points, strict=True)]

        def searched(seed: int, evaluations: int, why: Known | None) -> Front:
            return search(
                evaluate, SPACE, objectives, evaluations=evaluations, seed=seed, constraints=CONSTRAINTS,
                confirmations=0, discard=why,
            )  # fmt: skip

        size = len(list(product(*(one.values for one in SPACE.values()))))
        begun = perf_counter()
        exact = searched(1, size, discard)
        print(
            f"{size} variants: {exact.discarded_share:.0%} discarded before a run, {exact.runs} runs in ",
            end="",
        )
        print(f"{perf_counter() - begun:.0f} s on {chosen.workers} workers, {exact.failed} failed")
        for why, count in exact.discarded.items():
            print(f"  {count} discarded: {why}")
        for one in exact.solutions:
            energy, time, dollars = (each.estimate for each in one.objectives)
            print(f"  {energy:6.0f} J  {time:6.1f} s  {dollars:5.0f} USD  {list(one.values.values())}")
        compare(chosen, exact, searched, discard, evaluate, objectives)


def compare(
    chosen: argparse.Namespace,
    exact: Front,
    searched: Callable[[int, int, Known | None], Front],
    discard: Known,
    evaluate: Callable[[Sequence[VariantPoint]], list[CampaignRow]],
    objectives: Sequence[Objective],
) -> None:
    """Print the hypervolumes of search and of random sampling at the same number of runs."""
    every = [dict(zip(SPACE, one, strict=True)) for one in product(*(p.values for p in SPACE.values()))]
    possible = [one for one in every if not discard(one)]
    rows = {row.point.variant: row for row in evaluate([VariantPoint(one) for one in possible])}

    def scores(variants: Sequence[Mapping[str, Value]]) -> Any:
        """Return what the feasible variants score; those that are discarded are known to be none."""
        found = [rows[key] for one in variants if (key := VariantPoint(one).variant) in rows]
        good = [row for row in found if all(row.verdicts.get(name) for name in CONSTRAINTS)]
        return np.array([[one.value(row) for one in objectives] for row in good]).reshape(-1, 3)

    all_scores = scores(possible)
    low, high = all_scores.min(axis=0), all_scores.max(axis=0)
    span = np.where(high > low, high - low, 1.0)

    def volume(points: Any) -> float:
        return hypervolume((points - low) / span, [1.1] * 3)

    whole = volume(all_scores)
    apart = {tuple(one) for one in all_scores[front_of(all_scores)]}
    proposed = searched(3, len(possible), discard)
    for name, front in (
        ("exhaustive", exact),
        (f"proposed by the search, {proposed.evaluated} runs", proposed),
    ):
        same = "the same as" if {tuple(one) for one in front.points()} == apart else "ANOTHER than"
        print(f"front, {name}: {len(front.solutions)} variants, {same} of all rows")
    ours, theirs, filtered = [], [], []
    for seed in range(1, chosen.repetitions + 1):
        ours.append(volume(searched(seed, chosen.budget, discard).points()))
        draw = np.random.default_rng(seed)
        theirs.append(volume(scores([every[i] for i in draw.permutation(len(every))[: chosen.budget]])))
        filtered.append(
            volume(scores([possible[i] for i in draw.permutation(len(possible))[: chosen.budget]]))
        )
    print(
        f"hypervolume at {chosen.budget} runs, share of the exact front's, {chosen.repetitions} repetitions"
    )
    for name, found in (("search", ours), ("random", theirs), ("random, with discards", filtered)):
        print(f"  {name:22} {mean([one / whole for one in found]).sentence('share')}")
    for name, found in (("random", theirs), ("random, with discards", filtered)):
        ratios = [one / other for one, other in zip(ours, found, strict=True)]
        print(f"  search / {name}: {mean(ratios).sentence('ratio')}")


if __name__ == "__main__":
    main()
