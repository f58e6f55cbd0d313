"""Native simulation judged: estimate against measurement here, instructions against qemu-aarch64's.

The kernels in bench/kernels were fixed before anything was calibrated. Block costs come from a trace with a
kernel's first input; they are judged on its fourth one, other data of another size and mix, which was written
when the model was finished. (The second and the third were looked at while it was made.)

  model     estimate by the core's figures alone (`volery cost calibrate processor`), nothing fitted to the
            kernel
  error     the same, times what the first input took here over what the model says it takes: one factor a
            kernel, from the calibration input; this is what is to stay below 10 % (mean) and 20 % (worst)
  slowdown  counting code over plain code
  A72       instructions of the kernel's own code on a Cortex-A72, against those that qemu-aarch64 executes

    python bench/native.py [--rounds 9] [--no-qemu] [--unseen] [kernel ...]

With --unseen the kernels of bench/unseen_kernels, which were written before their errors were known. What was
mended with some of them in view is stated in docs/native-simulation.md.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory

from volery.calibration.core_measurement import core_law, isa, measure
from volery.calibration.host_machine import this_machine
from volery.calibration.queue_measurement import measure_queues
from volery.cost import load_catalogue
from volery.cost.code_laws import CoreLaw
from volery.cost.native.block_costs import BlockCosts, traced_costs
from volery.cost.native.compilation import OptimisedCode, compile_program, run_tool
from volery.cost.native.instrumented_run import (
    WINDOW,
    Invocation,
    block_counts,
    build_executable,
    build_timing,
    time_activations,
    trace_blocks,
)

KERNELS = Path(__file__).parent / "kernels"
UNSEEN = Path(__file__).parent / "unseen_kernels"
CALIBRATING, JUDGING = 0, 3
ACTIVATIONS = 12
MOST_TRACED = 400_000
A72 = "rpi4-cortex-a72"
MAIN = """
void prepare(int); double kernel(void); volatile double kept;
int main(int count, char **words) {{
    prepare({input});
    for (int i = *words[1] - '0'; i > 0; --i)
        kept = kernel();
}}
"""
PRIMES = """
extern "C" double kernel() {
    unsigned long long found = 0;
    for (unsigned long long number = 3; number < 10000; ++number) {
        unsigned long long divisor = 2, last = __builtin_sqrt((double)number);
        while (divisor <= last && number % divisor != 0)
            ++divisor;
        found += divisor > last;
    }
    return found;
}
"""


@dataclass(frozen=True)
class Judged:
    """Errors are relative; ``model`` without, ``error`` with the factor of the calibration input."""

    name: str
    estimated: float
    measured: float
    model: float
    error: float
    slowdown: float


def wanted(given: int) -> Invocation:
    return Invocation("kernel", (f"prepare({given})",))


def costs_of(program: OptimisedCode, folder: Path, run: Invocation) -> BlockCosts:
    program.traced_object(folder / "traced.o")
    executable = build_executable(program, run, folder / "traced.o", folder)
    ran = trace_blocks(executable, run, folder, WINDOW, program.law.memory)
    return traced_costs(program, ran.until(MOST_TRACED))[0]


def judge(path: Path, law: CoreLaw, rounds: int, folder: Path) -> Judged:
    program = compile_program([path], law)
    costs = costs_of(program, folder, wanted(CALIBRATING))
    program.counted_object(folder / "counted.o")
    program.plain_object(folder / "plain.o")
    estimated, timers = {}, {}
    for given in (CALIBRATING, JUDGING):
        place = folder / str(given)
        place.mkdir()
        run = wanted(given)
        entered = block_counts(build_executable(program, run, folder / "counted.o", place), run, place)
        estimated[given] = costs.total(entered) + costs.waiting(entered) * law.greatest_mhz / 1000.0
        timers["plain", given] = build_timing(program, run, folder / "plain.o", place).rename(place / "plain")
        timers["counted", given] = build_timing(program, run, folder / "counted.o", place).rename(
            place / "counted"
        )
    took: dict[tuple[str, int], list[float]] = {key: [] for key in timers}
    for _ in range(rounds):  # in turns, so that whatever disturbs disturbs all
        for key, timer in timers.items():
            took[key].append(median(time_activations(timer, ACTIVATIONS)))
    plain = {given: median(took["plain", given]) for given in (CALIBRATING, JUDGING)}
    factor = plain[CALIBRATING] / estimated[CALIBRATING]
    return Judged(
        path.stem,
        factor * estimated[JUDGING],
        plain[JUDGING],
        estimated[JUDGING] / plain[JUDGING] - 1.0,
        factor * estimated[JUDGING] / plain[JUDGING] - 1.0,
        median(took["counted", JUDGING]) / plain[JUDGING],
    )


def on_this_machine(paths: list[Path], rounds: int) -> None:
    with TemporaryDirectory() as made:
        taken = measure(Path(made, "notes"), lambda name, done, whole: None)
    law = core_law(this_machine("host"), isa(), taken, measure_queues())
    print(f"this machine at {law.greatest_mhz:g} MHz; cycles of one activation with the judging input")
    print(f"{'kernel':18}{'estimated':>12}{'measured':>12}{'error':>9}{'model':>9}{'slowdown':>10}")
    judged = []
    for path in paths:
        with TemporaryDirectory() as made:
            one = judge(path, law, rounds, Path(made))
        judged.append(one)
        print(
            f"{one.name:18}{one.estimated:12,.0f}{one.measured:12,.0f}{one.error:+9.1%}{one.model:+9.1%}"
            f"{one.slowdown:9.2f}x",
            flush=True,
        )
    for what, errors in (
        ("error", [abs(one.error) for one in judged]),
        ("model", [abs(one.model) for one in judged]),
    ):
        print(f"{what}: mean {mean(errors):.1%}, median {median(errors):.1%}, worst {max(errors):.1%}")
    slower = [one.slowdown for one in judged]
    print(f"slowdown: median {median(slower):.2f}x, worst {max(slower):.2f}x\n")


def executed(program: OptimisedCode, given: int, folder: Path) -> int:
    """Instructions of the program's own functions in one activation, as qemu-aarch64 executes them."""
    (folder / "code.s").write_text(program.assembly, encoding="utf-8")
    (folder / "main.c").write_text(MAIN.format(input=given), encoding="utf-8")
    out = folder / "on-arm"
    target = ["--target=aarch64-linux-gnu", "-static", "-fuse-ld=lld", "-O1", "-w"]
    files = ["-x", "assembler", str(folder / "code.s"), "-x", "c", str(folder / "main.c")]
    run_tool(["clang++-19", *target, *files, "-o", str(out)])
    listed = subprocess.run(
        ["llvm-nm-19", "-S", "--defined-only", out], capture_output=True, text=True, check=True
    )
    symbols = [line.split() for line in listed.stdout.splitlines()]
    own = ",".join(f"0x{one[0]}+0x{one[1]}" for one in symbols if len(one) == 4 and one[3] in program.defined)
    lines = []
    for activations in "01":
        command = [
            "qemu-aarch64",
            "-singlestep",
            "-d",
            "exec,nochain",
            "-dfilter",
            own,
            str(out),
            activations,
        ]
        with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as running:
            assert running.stderr is not None
            lines.append(sum(1 for _ in running.stderr))
    return lines[1] - lines[0]


def on_a72(paths: list[Path]) -> None:
    law = load_catalogue().processor(A72).core_law()
    print("instructions on a Cortex-A72, judging input: estimated, executed by qemu-aarch64")
    errors = []
    for path in paths:
        program = compile_program([path], law)
        with TemporaryDirectory() as made:
            folder = Path(made)
            costs = costs_of(program, folder, wanted(CALIBRATING))
            program.counted_object(folder / "counted.o")
            run = wanted(JUDGING)
            entered = block_counts(build_executable(program, run, folder / "counted.o", folder), run, folder)
            estimated, real = float(costs.instructions @ entered), executed(program, JUDGING, folder)
        errors.append(abs(estimated / real - 1.0))
        print(f"{path.stem:18}{estimated:12,.0f}{real:12,} {estimated / real - 1.0:+8.2%}", flush=True)
    print(f"mean {mean(errors):.2%}, worst {max(errors):.2%}\n")


def anchors() -> None:
    law = load_catalogue().processor(A72).core_law()
    with TemporaryDirectory() as made:
        folder = Path(made)
        source = folder / "primes.cpp"
        source.write_text(PRIMES, encoding="utf-8")
        program, run = compile_program([source], law), Invocation("kernel")
        costs = costs_of(program, folder, run)
        program.counted_object(folder / "counted.o")
        cycles = costs.total(
            block_counts(build_executable(program, run, folder / "counted.o", folder), run, folder)
        )
    print("published for a Raspberry Pi 4, beside the model's figure (nothing fitted to either)")
    print(f"sysbench cpu, primes below 10,000, events/s at 1500 MHz: 1478, estimated {1.5e9 / cycles:.0f}")
    print("CoreMark/MHz: about 5.5, not estimated: its sources are not part of this project")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kernels", nargs="*")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--no-qemu", action="store_true")
    parser.add_argument("--unseen", action="store_true")
    given = parser.parse_args()
    folder = UNSEEN if given.unseen else KERNELS
    paths = [folder / f"{name}.cpp" for name in given.kernels] or sorted(folder.glob("*.cpp"))
    on_this_machine(paths, given.rounds)
    if given.no_qemu or shutil.which("qemu-aarch64") is None:
        print("no qemu-aarch64 (scripts/debian-packages native qemu): instructions are not compared\n")
    else:
        on_a72(paths)
    anchors()


if __name__ == "__main__":
    main()
