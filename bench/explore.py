"""What a campaign costs beside the runs that it makes, and what it holds in memory.

    python bench/explore.py [--runs 60] [--rows 100000] [--reference CHECKOUT]

Processor seconds, all processes of a campaign included. Rounds in this process and campaigns take turns, so
both meet the same machine. `--reference` is a checkout of an older volery whose command is called for each
run, as campaigns had to be written before. Rows of the large table are made by a stub of the engine.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np
import pyarrow as pa

from volery.explore.campaign import CampaignRequest, prepare
from volery.explore.campaign_store import CampaignStore
from volery.explore.executors import executors
from volery.explore.points import Point, Row
from volery.explore.specification import run_seed
from volery.run.result import Options
from volery.run.run_session import read_system
from volery.run.simulate import simulate

STARTER = Path(__file__).parents[1] / "examples" / "starter"
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
OBSERVABLES = 51
"""As many as a run of the starter has."""


class Stub(Executor):
    """Stands for an engine: makes a row at once, of numbers that depend on the seed."""

    def __init__(self, address: str, workers: int) -> None:
        self.workers = workers or 2

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        (task,) = arguments
        future: Future[Any] = Future()
        values = np.random.default_rng(task.point.seed).random(OBSERVABLES)
        observables = {f"subject.quantity_{place}": float(one) for place, one in enumerate(values)}
        verdicts = {"landing": bool(values[0] < 0.97), "battery": True}
        future.set_result(
            Row(task.run, task.point, "completed", "", verdicts, observables, 100.0, 0.3, 0.3, "stub")
        )
        return future


executors.add("stub", Stub)


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


def campaign_costs(folder: Path, runs: int, workers: int) -> tuple[float, float, tuple[float, float]]:
    """Run a campaign of the starter. Return processor seconds, wall seconds, and memory of a worker."""
    before, began = process_time(), perf_counter()
    with prepare(CampaignRequest.of(STARTER, folder, workers=workers, seeds=runs)) as campaign:
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


def against_command_line(runs: int, folder: Path, checkout: Path | None) -> None:
    """Compare a campaign with one call of an older command for each run."""
    used, _, _ = campaign_costs(folder / "whole", runs, 2)
    each, source = 1.28, "stated"
    if checkout is not None:
        source = "measured"
        command = [
            sys.executable,
            "-c",
            "from volery.cli.main import main; main()",
            "simulate",
            str(checkout / "examples/starter"),
        ]
        environment = os.environ | {"PYTHONPATH": str(checkout / "src")}
        calls = []
        for seed in range(1, 7):  # the first one compiles
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
        f"{runs} runs: {used:.1f} s of processor time, start included; by the command line of 0001042e "
        f"{runs * each:.0f} s ({each:.2f} s each, {source}): 1/{runs * each / used:.1f} (bound: 1/6)"
    )


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


def large_table(rows: int, folder: Path) -> None:
    """Write, resume and read a table; each in a process, whose peak is printed."""
    steps = {
        "written": f"explore({str(STARTER)!r}, {str(folder)!r}, on='stub', seeds={rows}).close()",
        "resumed": f"explore({str(STARTER)!r}, {str(folder)!r}, on='stub', seeds={rows + 1000}).close()",
        "read": f"assert len(Campaign({str(folder)!r}).table()) == {rows + 1000}",
    }
    for what, code in steps.items():
        script = (
            f"import sys, resource; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
            "import explore as bench\nfrom volery.explore.campaign import Campaign, explore\n"
            "from time import perf_counter\n"
            f"began = perf_counter(); {code}\n"
            "print(perf_counter() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)"
        )
        done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
        seconds, peak = map(float, done.stdout.split())
        size = sum(one.stat().st_size for one in folder.iterdir()) / 1e6
        print(f"{rows:,} rows (stub) {what}: {seconds:.1f} s, {peak:.0f} MB at most, folder {size:.0f} MB")


def stores(rows: int, folder: Path) -> None:
    """Compare the store with an Arrow stream, a batch a row, as each row must be safe when it is written."""
    points = [Point({}, seed) for seed in range(rows)]
    values = {f"subject.quantity_{place}": place / 7.0 for place in range(OBSERVABLES)}
    store = CampaignStore(folder / "sqlite", write=True)
    store.ask(points)
    before = process_time()
    for number, point in enumerate(points):
        store.record([Row(number, point, "completed", "", {}, values)])
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
    parser.add_argument("--reference", type=Path)
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as made:
        folder = Path(made)
        overhead(options.runs, folder)
        against_command_line(200, folder, options.reference)
        two_workers(options.runs, folder)
        stores(3000, folder)
        large_table(options.rows, folder / "table")


if __name__ == "__main__":
    main()
