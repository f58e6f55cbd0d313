"""What a campaign costs beside the runs that it makes, and what it holds in memory.

    python bench/explore.py [--runs 60] [--rows 100000] [--deliveries 10] [--reference CHECKOUT]

Processor seconds, all processes of a campaign included. Rounds in this process and campaigns take turns, so
both meet the same machine. `--reference` is a checkout of an older volery whose command is called for each
run, as campaigns had to be written before. Rows of the large table are made by a stub of the engine.
"""

from __future__ import annotations

import argparse
import os
import pickle
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import pyarrow as pa

from explore_stub import OBSERVABLES
from volery.explore.campaign import Campaign, CampaignRequest, prepare
from volery.explore.campaign_store import CampaignStore
from volery.explore.points import CampaignRow, VariantPoint
from volery.explore.run_process import PlannedRun
from volery.explore.specification import run_seed
from volery.kernel import virtual
from volery.run.result import Options
from volery.run.run_session import read_system
from volery.run.simulate import simulate
from volery.simulation.world.body_step import advance_bodies

EXAMPLES = Path(__file__).parents[1] / "examples"
STARTER, DELIVERY = EXAMPLES / "starter", EXAMPLES / "delivery"
STATED_S = {STARTER: 1.28, DELIVERY: 5.9}
"""Processor seconds of a call of `volery simulate --record none` of commit 0001042e, plain Python."""
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def descendants(pid: int) -> Iterator[int]:
    """The processes below a process."""
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            yield child
            yield from descendants(child)


def used_s(pid: int) -> float:
    """Processor seconds of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def memory_mb(pid: int) -> tuple[float, float]:
    """Resident memory of a process, and its share of what it has in common with others."""
    lines = (line.split() for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:])
    sizes = {words[0]: float(words[1]) / 1e3 for words in lines}
    return sizes["Rss:"], sizes["Pss:"]


def campaign_costs(
    folder: Path, runs: int, workers: int, model: Path = STARTER
) -> tuple[float, float, tuple[float, float]]:
    """Run a campaign. Return processor seconds, wall seconds, and memory of a worker."""
    before, began = process_time(), perf_counter()
    with prepare(CampaignRequest.of(model, folder, workers=workers, seeds=runs)) as campaign:
        campaign.run(campaign.specification.run_points())
        wall = perf_counter() - began
        below = list(descendants(os.getpid()))
        used = process_time() - before + sum(map(used_s, below))
        largest = max(map(memory_mb, below))
    return used, wall, largest


def overhead(runs: int, folder: Path) -> float:
    """Compare campaigns with calls of ``simulate`` on the same seeds. Return seconds of a run."""
    system = read_system(STARTER)
    simulate(system)  # reads and compiles
    plain, added = [], []
    for turn in range(3):
        before = process_time()
        for number in range(runs):
            simulate(system, Options(seed=run_seed(1, number)))
        plain.append((process_time() - before) / runs)
        few, _, _ = campaign_costs(folder / f"few-{turn}", 2, 1)
        many, _, worker = campaign_costs(folder / f"many-{turn}", runs + 2, 1)
        added.append((many - few) / runs)
        print(
            f"  a run {1e3 * plain[-1]:.0f} ms, in a campaign {1e3 * added[-1]:.0f} ms; "
            f"start {few - 2 * added[-1]:.2f} s"
        )
    print(
        f"a campaign adds {1e3 * (median(added) - median(plain)):.1f} ms of processor time to a run "
        "(bound: 20 ms)"
    )
    print(
        f"a worker holds {worker[0]:.0f} MB, {worker[1]:.0f} MB with what it shares divided (bound: 160 MB)"
    )
    return median(plain)


def against_command_line(model: Path, runs: int, folder: Path, checkout: Path | None, bound: float) -> float:
    """Compare a campaign with one call of an older command for each run. Return its seconds for a run."""
    used, _, _ = campaign_costs(folder / f"whole-{model.name}", runs, 2, model)
    each, source = STATED_S[model], "stated"
    if checkout is not None:
        source = "measured"
        command = [
            sys.executable,
            "-c",
            "from volery.cli.main import main; main()",
            "simulate",
            str(checkout / "examples" / model.name),
        ]
        environment = os.environ | {"PYTHONPATH": str(checkout / "src")}
        calls = []
        for seed in range(1, 5):  # the first one compiles
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(
                [*command, "--record", "none", "--seed", str(seed), "--quiet"],
                env=environment,
                check=True,
                capture_output=True,
            )
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            calls.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        each = median(calls[1:])
    print(
        f"{runs} runs of {model.name}: {used:.1f} s of processor time, start included; by the older command "
        f"line {runs * each:.0f} s ({each:.2f} s each, {source}): 1/{runs * each / used:.1f} "
        f"(bound: 1/{bound:g})"
    )
    return used / runs


def two_workers(runs: int, folder: Path) -> None:
    """Compare one worker with two."""
    walls = {}
    for workers in (1, 2):
        few = min(
            campaign_costs(folder / f"w{workers}-few-{turn}", 2 * workers, workers)[1] for turn in range(2)
        )
        many = min(campaign_costs(folder / f"w{workers}-many-{turn}", runs, workers)[1] for turn in range(2))
        walls[workers] = (many - few) / (runs - 2 * workers)
    print(f"two workers are {walls[1] / walls[2]:.2f} times as fast as one (bound: 1.8)")


def tier() -> str:
    """Return what of volery is machine code here."""
    compiled = not (virtual.__file__ or "").endswith(".py")
    return (
        f"physics: {'object code of a wheel' if advance_bodies.shipped else 'compiled by numba'}; "
        f"events: {'compiled' if compiled else 'plain Python'}"
    )


def large_table(rows: int, folder: Path) -> float:
    """Write, resume, report and read a table; each in a process, whose peak is printed.

    Return processor seconds of the coordinator for a row.
    """
    step = f"explore(CampaignRequest.of({str(STARTER)!r}, {str(folder)!r}, on='stub', seeds="
    opened = f"Campaign({str(folder)!r})"
    steps = {
        "written, with Parquet": f"{step}{rows})).close()",
        "resumed, 1,000 more": f"{step}{rows + 1000})).close()",
        "on the page": f"write_page({opened})",
        "a run of it made again": f"{opened}.show({rows - 1}, {str(folder / 'again')!r})",
        "as a data frame": f"assert len({opened}.table()) == {rows + 1000}",
    }
    needed = []
    for what, code in steps.items():
        script = (
            f"import sys, resource; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
            "import explore_stub\nfrom volery.explore.campaign import Campaign, CampaignRequest, explore\n"
            "from volery.explore.campaign_page import write_page\n"
            "from time import process_time\n"
            f"began = process_time(); {code}\n"
            "print(process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)"
        )
        done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
        seconds, peak = map(float, done.stdout.split())
        needed.append(seconds)
        print(f"{rows:,} rows (stub) {what}: {seconds:.1f} s of processor time, {peak:.0f} MB at most")
    for file in sorted(folder.iterdir()):
        if file.is_file() and (size := file.stat().st_size) > 1e4:
            print(f"  {file.name}: {size / 1e6:.1f} MB, {size / rows:.0f} bytes a row")
    return needed[0] / rows


def on_paper(delivery_s: float, row_s: float, deliveries: Path, runs: float = 1e6, cores: int = 1000) -> None:
    """Say what a large campaign of deliveries costs by what was measured, and what is full first."""
    with Campaign(deliveries) as campaign:
        row = campaign.row(0)
        task = PlannedRun(campaign.setting, row.run, row.point)
    traffic, stored = len(pickle.dumps(task)) + len(pickle.dumps(row)), 8 * len(row.observables) + 100
    wall_s = runs * delivery_s / cores
    rate = runs / wall_s
    print(
        f"{runs:,.0f} deliveries on {cores:,} cores, on paper: {delivery_s:.2f} s each, "
        f"{wall_s / 60:.0f} min, {rate:.0f} rows/s;\n"
        f"  the coordinator needs {1e6 * row_s:.0f} µs a row, {rate * row_s:.0%} of a core: full at "
        f"{cores / (rate * row_s):,.0f} cores;\n"
        f"  {traffic:,} bytes a run on the network, {rate * traffic / 1e6:.1f} MB/s; some {stored:,} bytes a "
        f"row on the disk, {runs * stored / 1e9:.1f} GB"
    )


def stores(rows: int, folder: Path) -> None:
    """Compare the store with an Arrow stream, a batch a row, as each row must be safe when it is written."""
    points = [VariantPoint({}, seed) for seed in range(rows)]
    values = {f"subject.quantity_{place}": place / 7.0 for place in range(OBSERVABLES)}
    store = CampaignStore(folder / "sqlite", write=True)
    store.ask(points)
    before = process_time()
    for number, point in enumerate(points):
        store.record([CampaignRow(number, point, "completed", "", {}, values)])
    print(
        f"SQLite: {1e6 * (process_time() - before) / rows:.0f} µs a row, "
        f"{_size(folder / 'sqlite') / rows:.0f} bytes"
    )
    store.close()
    path = folder / "stream.arrow"
    schema = pa.schema([("run", pa.int64()), *((name, pa.float64()) for name in values)])
    before = process_time()
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_stream(file, schema) as writer:
        for number in range(rows):
            columns = [pa.array([number]), *(pa.array([one]) for one in values.values())]
            writer.write_batch(pa.record_batch(columns, schema))
    print(
        f"Arrow stream: {1e6 * (process_time() - before) / rows:.0f} µs a row, "
        f"{path.stat().st_size / rows:.0f} bytes"
    )


def _size(folder: Path) -> int:
    return sum(one.stat().st_size for one in folder.iterdir())


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--deliveries", type=int, default=10)
    parser.add_argument("--reference", type=Path)
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as made:
        folder = Path(made)
        print(tier())
        overhead(options.runs, folder)
        against_command_line(STARTER, 200, folder, options.reference, 6.0)
        delivery_s = against_command_line(DELIVERY, options.deliveries, folder, options.reference, 2.0)
        two_workers(options.runs, folder)
        stores(3000, folder)
        row_s = large_table(options.rows, folder / "table")
        on_paper(delivery_s, row_s, folder / f"whole-{DELIVERY.name}")


if __name__ == "__main__":
    main()
