"""Processor time of what users wait for, as ratios to another checkout of volery in the same run.

Each row is executed by turns with this checkout and with the other, each in its own virtual environment; the
figures are minima of CPU seconds (user and system, children included) over the rounds. The kernel's rows are
in ``bench/kernel.py``, the bodies' in ``bench/physics.py``, the messages' in ``bench/graph.py``. For the
figures of a wheel, install it in the .venv of a folder that has ``examples`` and ``bench/kernels`` as well.

    python bench/speed.py --against ../volery-before [--here FOLDER] [--rounds 3] [--only delivery]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
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
loop = total if out else sum(spent)
print(loop, (out / "trace.mcap").stat().st_size if out else 0)
"""


class Measured(NamedTuple):
    """CPU seconds, and bytes written where a row has them."""

    seconds: float
    size: float = 0.0


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
    """Run the command line and return the CPU seconds of it and its children."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    if cache is not None:
        environment |= {"NUMBA_CACHE_DIR": cache, "XDG_CACHE_HOME": cache}
    program = [str(checkout / ".venv/bin/volery"), *arguments]
    process = subprocess.Popen(
        program, cwd=checkout, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode > 1:
        sys.exit(f"{' '.join(program)}: {process.stderr.read().decode() if process.stderr else ''}")
    return Measured(usage.ru_utime + usage.ru_stime)


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


def delivery(checkout: Path, traced: bool) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        return script(checkout, DELIVERY, folder if traced else "")


def mission(url: str, drones: int) -> Callable[[Path], Measured]:
    return lambda checkout: script(checkout, FLIGHT, url, str(drones))


ROWS: dict[str, tuple[Callable[[Path], Measured], str]] = {
    "delivery, code, without files (loop)": (lambda checkout: delivery(checkout, traced=False), "3 x"),
    "delivery, code, full trace": (lambda checkout: delivery(checkout, traced=True), "2.2 x"),
    "one drone, warm (ardupilot)": (mission("sim:ardupilot", 1), "2 x"),
    "twenty drones": (mission("sim:ardupilot", 20), "2.5 x"),
    "one drone, warm (px4)": (mission("sim:px4", 1), "1.5 of ardupilot's time"),
    "one drone, warm (dji)": (mission("sim:dji", 1), "1.5 of ardupilot's time"),
    "volery fly, warm": (fly, "3 x"),
    "volery fly, empty cache": (first_fly, "warm + 1 s"),
    "volery cost, warm": (warm_cost, "2 x"),
    "volery cost, empty cache": (first_cost, "warm + 1 s"),
}


def smallest(rounds: list[Measured]) -> Measured:
    return min(rounds, key=lambda one: one.seconds)


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
    print(f"{'CPU seconds':40}{'reference':>10}{'here':>10}{'ratio':>8}  to reach", flush=True)
    for name, (measure, wanted) in ROWS.items():
        if given.only not in name:
            continue
        rounds = [(measure(other), measure(measured)) for _ in range(given.rounds)]
        reference = smallest([one for one, _ in rounds])
        here = smallest([one for _, one in rounds])
        ratio = reference.seconds / here.seconds
        line = f"{name:40}{reference.seconds:10.2f}{here.seconds:10.2f}{ratio:7.2f}x  {wanted}"
        if here.size:
            line += f"; trace {reference.size / 1e6:.1f} -> {here.size / 1e6:.1f} MB"
        print(line, flush=True)


if __name__ == "__main__":
    main()
