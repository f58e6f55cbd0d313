"""Processor time of what users wait for, as ratios to a reference in the same run.

Rows of ``AGAINST`` compare this checkout with another one, each in its own virtual environment; rows of
``WITHIN`` compare two things that this checkout does. Both are executed by turns, and the figures are minima
of CPU seconds (user and system, all descendants included) over the rounds. The kernel's rows are in
``bench/kernel.py``, the bodies' in ``bench/physics.py``, the messages' in ``bench/graph.py``. For the figures
of a wheel, install it in the .venv of a folder that has ``examples`` and ``bench/kernels`` as well.

    python bench/speed.py --against ../volery-before [--here FOLDER] [--rounds 3] [--only delivery]
"""

from __future__ import annotations

import argparse
import ctypes
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent.parent

FLIGHT = """
import sys, time, volery
sys.path.insert(0, "examples")
from mission import HOME, mission
url, drones = sys.argv[1], int(sys.argv[2])
home = lambda k: f"{url}?start=warm&home={HOME.latitude + 0.0001 * k},{HOME.longitude},900"
urls = [home(k) for k in range(drones)] if drones > 1 else url
fly = lambda: volery.fly(mission, urls, volery.Options(seed=1))
fly()
best = 1e9
for _ in range(3):
    start = time.process_time(); run = fly(); best = min(best, time.process_time() - start)
assert run.completed, run.record.outcome.reason
print(best)
"""

DELIVERY = """
import sys, time, tempfile, volery
from pathlib import Path
out = Path(tempfile.mkdtemp(dir=sys.argv[1])) / "run" if sys.argv[1] else None
from volery.run.simulate import simulate
import volery.run.ending as ending
spent = []
original = ending.Ending.pass_time
def pass_time(self):
    start = time.process_time(); result = original(self); spent.append(time.process_time() - start)
    return result
ending.Ending.pass_time = pass_time
options = volery.Options(fidelity="code", seed=7, out=out)
start = time.process_time()
run = simulate("examples/delivery", options, overrides=["run.duration=60 s"])
total = time.process_time() - start
print(sum(spent) if sys.argv[2] else total, (out / "trace.mcap").stat().st_size if out else 0)
"""

PR_SET_CHILD_SUBREAPER = 36
"""From ``linux/prctl.h``: processes whose parent has ended become children of this one."""


class Measured(NamedTuple):
    """CPU seconds, and bytes written where a row has them."""

    seconds: float
    size: float = 0.0


Measure = Callable[[Path], Measured]


def python(checkout: Path) -> Path:
    return checkout / ".venv/bin/python"


def script(checkout: Path, source: str, *arguments: str) -> Measured:
    """Run a program that prints its CPU seconds, and perhaps a size."""
    done = subprocess.run(
        [python(checkout), "-c", source, *arguments],
        cwd=checkout, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return Measured(*map(float, done.stdout.split()[-2 if " " in done.stdout.strip() else -1 :]))


def command(checkout: Path, *arguments: str, cache: str | None = None) -> Measured:
    """Run the command line and return the CPU seconds of it and its descendants."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    if cache is not None:
        environment |= {"NUMBA_CACHE_DIR": cache, "XDG_CACHE_HOME": cache}
    program = [str(checkout / ".venv/bin/volery"), *arguments]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        program, cwd=checkout, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False
    )
    if done.returncode > 1:
        sys.exit(f"{' '.join(program)}: {done.stderr.decode()}")
    try:
        while True:  # until the last process that it has left behind has ended
            os.wait()
    except ChildProcessError:
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Measured(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)


def fly(checkout: Path, cache: str | None = None) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        here = ("--on", "sim:ardupilot", "--seed", "1", "--quiet", "--out", f"{folder}/run")
        return command(checkout, "fly", "examples/mission.py", *here, cache=cache)


def first_fly(checkout: Path) -> Measured:
    with tempfile.TemporaryDirectory() as cache:
        return fly(checkout, cache)


def cost(checkout: Path, cache: str) -> Measured:
    kernel = str(HERE / "bench/kernels/quaternion.cpp")
    calls = ("--before", "prepare(0)", "--entry", "kernel()")
    return command(checkout, "cost", kernel, *calls, "--on", "rpi4-cortex-a72@600MHz", cache=cache)


def first_cost(checkout: Path) -> Measured:
    with tempfile.TemporaryDirectory() as cache:
        return cost(checkout, cache)


def warm_cost(checkout: Path) -> Measured:
    with tempfile.TemporaryDirectory() as cache:
        cost(checkout, cache)
        return cost(checkout, cache)


def demo(checkout: Path) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        return command(checkout, "demo", "--quiet", "--out", f"{folder}/runs")


def delivery(traced: bool, loop: bool) -> Measure:
    """Return what measures 60 s of orders: the simulation loop alone, or the whole run."""

    def measure(checkout: Path) -> Measured:
        with tempfile.TemporaryDirectory() as folder:
            return script(checkout, DELIVERY, folder if traced else "", "loop" if loop else "")

    return measure


def mission(url: str, drones: int = 1) -> Measure:
    return lambda checkout: script(checkout, FLIGHT, url, str(drones))


AGAINST: dict[str, tuple[Measure, str]] = {
    "delivery, code, without files (loop)": (delivery(traced=False, loop=True), "3 x"),
    "delivery, code, full trace": (delivery(traced=True, loop=False), "2.2 x"),
    "one drone, warm (ardupilot)": (mission("sim:ardupilot"), "2 x"),
    "twenty drones": (mission("sim:ardupilot", 20), "2.5 x"),
    "volery fly, warm": (fly, "3 x"),
    "volery cost, warm": (warm_cost, "2 x"),
    "volery demo, second time": (demo, "3 x"),
}
WITHIN: dict[str, tuple[Measure, Measure, str]] = {
    "delivery with trace, loop": (
        delivery(traced=False, loop=True), delivery(traced=True, loop=True), "1.15 of it without files",
    ),
    "one drone, warm (px4)": (mission("sim:ardupilot"), mission("sim:px4"), "1.5 of ardupilot's"),
    "one drone, warm (dji)": (mission("sim:ardupilot"), mission("sim:dji"), "1.5 of ardupilot's"),
    "volery fly, empty cache": (fly, first_fly, "1 s more than warm"),
    "volery cost, empty cache": (warm_cost, first_cost, "1 s more than warm"),
}  # fmt: skip


def smallest(rounds: list[Measured]) -> Measured:
    return min(rounds, key=lambda one: one.seconds)


def compare(
    name: str, wanted: str, rounds: int, of: Callable[[], Measured], to: Callable[[], Measured]
) -> None:
    """Print a row: minima over the rounds of the reference *to* and of what is measured, by turns."""
    measured = [(to(), of()) for _ in range(rounds)]
    reference, here = smallest([one for one, _ in measured]), smallest([one for _, one in measured])
    line = f"{name:40}{reference.seconds:10.2f}{here.seconds:10.2f}{reference.seconds / here.seconds:7.2f}x"
    if here.size and reference.size:
        wanted += f"; trace {reference.size / 1e6:.1f} -> {here.size / 1e6:.1f} MB"
    print(f"{line}{here.seconds / reference.seconds:8.2f}  {wanted}", flush=True)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--against", type=Path, default=HERE, help="a checkout with its own .venv")
    options.add_argument("--here", type=Path, default=HERE, help="what is measured; by default this checkout")
    options.add_argument("--rounds", type=int, default=3)
    options.add_argument("--only", default="", help="rows whose name contains this")
    given = options.parse_args()
    other, measured = given.against.resolve(), given.here.resolve()
    for folder in (other, measured):
        if not python(folder).exists():
            sys.exit(f"speed: {folder} has no .venv/bin/python; install volery there in a .venv of its own")
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    print(f"{'CPU seconds':40}{'reference':>10}{'here':>10}{'ratio':>8}{'share':>8}  to reach", flush=True)
    for name, (measure, wanted) in AGAINST.items():
        if given.only in name:
            compare(name, wanted, given.rounds, partial(measure, measured), partial(measure, other))
    for name, (reference, measure, wanted) in WITHIN.items():
        if given.only in name:
            compare(name, wanted, given.rounds, partial(measure, measured), partial(reference, measured))


if __name__ == "__main__":
    main()
