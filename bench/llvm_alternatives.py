"""LLVM's own tools beside ours, on the kernels of bench/native.py: llvm-mca's block costs, coverage passes.

Costs: cycles of one activation with the judging input, from the counts of basic blocks times the cost of each
block, against the cycles measured here. Nothing is fitted to a kernel.

  traced    our core model on the traced sequence of blocks
  alone     our core model, each block sixteen times in a row
  mca       llvm-mca, each block a hundred times in a row, with LLVM's tables for this processor
  mca rt    llvm-mca's reciprocal throughput of the block

Counters: time of the kernel with each instrumentation of the same optimised code, over plain code.

    python bench/llvm_alternatives.py [--rounds 7] [kernel ...]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from native import ACTIVATIONS, JUDGING, KERNELS, costs_of, wanted
from volery.calibration.core_measurement import core_law, isa, measure
from volery.calibration.host_machine import this_machine
from volery.calibration.queue_measurement import measure_queues
from volery.cost.code_laws import CoreLaw
from volery.cost.native.block_costs import blocks_of, static_costs
from volery.cost.native.compilation import (
    HOST_TARGET,
    OptimisedCode,
    compile_program,
    llvm_toolchain,
    run_tool,
)
from volery.cost.native.instrumented_run import (
    block_counts,
    build_executable,
    build_timing,
    time_activations,
)
from volery.cost.native.llvm_ir import retarget
from volery.cost.native.path_reconstruction import MachineCode

ITERATIONS = 100
PASSES = {
    "pgo": ("-passes=pgo-instr-gen,instrprof", "-disable-vp"),
    "pgo promoted": ("-passes=pgo-instr-gen,instrprof", "-disable-vp", "-do-counter-promotion"),
    "sancov 8-bit": (
        "-passes=sancov-module",
        "-sanitizer-coverage-level=3",
        "-sanitizer-coverage-inline-8bit-counters",
    ),
    "sancov guard": (
        "-passes=sancov-module",
        "-sanitizer-coverage-level=3",
        "-sanitizer-coverage-trace-pc-guard",
    ),
}
RUNTIME = """
#include <stdint.h>
static uint64_t counts[1 << 20];
int __llvm_profile_runtime;
void __sanitizer_cov_trace_pc_guard_init(uint32_t *at, uint32_t *end) {
    static uint32_t last;
    if (at != end && !*at)
        for (; at < end; ++at) *at = ++last;
}
void __sanitizer_cov_trace_pc_guard(uint32_t *guard) { counts[*guard]++; }
void __sanitizer_cov_8bit_counters_init(char *at, char *end) {}
void __sanitizer_cov_pcs_init(const uintptr_t *at, const uintptr_t *end) {}
"""
"""What instrumented code calls: the least that links and counts."""


def mca_costs(program: OptimisedCode) -> tuple[Any, Any]:
    """Return cycles per entry of each block: in a steady state, and as reciprocal throughput."""
    machine = MachineCode(program.blocks, program.machine_blocks)
    text = [".intel_syntax noprefix", ".L0:"]
    for block, first in machine.first_of_block.items():
        lines = [
            f"{one.mnemonic} .L0"
            if one.mnemonic.startswith("j")
            else f"{one.mnemonic}\t{', '.join(one.operands)}"
            for piece in blocks_of(machine, first)
            for one in program.machine_blocks[piece].instructions
            if not one.mnemonic.startswith(("call", "ret")) and one.mnemonic != "jmp"
        ]
        if lines:
            text += [f"# LLVM-MCA-BEGIN {block}", *lines, "# LLVM-MCA-END"]
    command = [
        llvm_toolchain().opt.replace("opt", "llvm-mca"), "-mtriple=x86_64", "-mcpu=native", "--json",
        f"-iterations={ITERATIONS}", "--skip-unsupported-instructions=any",
    ]  # fmt: skip
    done = subprocess.run(command, input="\n".join(text) + "\n", capture_output=True, text=True, check=True)
    steady, throughput = np.zeros(len(program.blocks)), np.zeros(len(program.blocks))
    for region in json.loads(done.stdout[done.stdout.index("{") :])["CodeRegions"]:
        summary = region["SummaryView"]
        steady[int(region["Name"])] = summary["TotalCycles"] / summary["Iterations"]
        throughput[int(region["Name"])] = summary["BlockRThroughput"]
    return steady, throughput


def timers(program: OptimisedCode, folder: Path) -> dict[str, Path]:
    """Build the kernel's timing program without counters, with ours and with each of LLVM's passes."""
    tools = llvm_toolchain()
    (folder / "runtime.c").write_text(RUNTIME, encoding="utf-8")
    run_tool(
        [tools.clang, "-O2", "-x", "c", "-c", str(folder / "runtime.c"), "-o", str(folder / "runtime.o")]
    )
    program.plain_object(folder / "plain.o")
    program.counted_object(folder / "ours.o")
    objects = {"plain": folder / "plain.o", "ours": folder / "ours.o"}
    here = retarget(program.text, *HOST_TARGET)
    for name, passes in PASSES.items():
        instrumented = run_tool([tools.opt, *passes, "-S", "-o", "-"], here)
        objects[name] = folder / f"{name}.o"
        run_tool(
            [tools.llc, "-O2", "-relocation-model=pic", "-filetype=obj", "-o", str(objects[name])],
            instrumented,
        )
    run = wanted(JUDGING)
    built = {}
    for name, code in objects.items():
        place = folder / f"timing {name}"
        place.mkdir()
        linked = (
            run if name in ("plain", "ours") else dataclasses.replace(run, links=(str(folder / "runtime.o"),))
        )
        built[name] = build_timing(program, linked, code, place)
    return built


def compare(path: Path, law: CoreLaw, rounds: int, folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Return the relative errors of each cost, and the slowdown by each instrumentation."""
    program = compile_program([path], law)
    traced = costs_of(program, folder, wanted(0))
    steady, throughput = mca_costs(program)
    built = timers(program, folder)
    run = wanted(JUDGING)
    (folder / "counting").mkdir()
    counts = block_counts(
        build_executable(program, run, folder / "ours.o", folder / "counting"), run, folder / "counting"
    )
    took: dict[str, list[float]] = {name: [] for name in built}
    for _ in range(rounds):  # alternating, so that other load affects all
        for name, timer in built.items():
            took[name].append(median(time_activations(timer, ACTIVATIONS)))
    plain = min(took["plain"])
    cycles = {
        "traced": traced.total(counts) + traced.waiting(counts) * law.greatest_mhz / 1000.0,
        "alone": static_costs(program).total(counts),
        "mca": float(steady @ counts),
        "mca rt": float(throughput @ counts),
    }
    errors = {name: estimated / plain - 1.0 for name, estimated in cycles.items()}
    return errors, {name: min(each) / plain for name, each in took.items() if name != "plain"}


def table(title: str, rows: Sequence[tuple[str, dict[str, float]]], form: str) -> None:
    """Print one row per kernel, then mean, median and worst of each column."""
    columns = list(rows[0][1])
    print(f"\n{title}\n{'kernel':18}" + "".join(f"{name:>14}" for name in columns))
    for name, row in rows:
        print(f"{name:18}" + "".join(f"{row[column]:>14{form}}" for column in columns))
    for label, of in (("mean", mean), ("median", median), ("worst", max)):
        print(
            f"{label:18}"
            + "".join(f"{of([abs(row[column]) for _, row in rows]):>14{form}}" for column in columns)
        )


def main() -> None:
    """Compare all kernels, or those named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("kernels", nargs="*")
    given = parser.parse_args()
    with TemporaryDirectory() as made:
        taken = measure(Path(made, "notes"), lambda name, done, whole: None)
    law = core_law(this_machine("host"), isa(), taken, measure_queues())
    errors, slowdowns = [], []
    for path in sorted(KERNELS.glob("*.cpp")):
        if given.kernels and path.stem not in given.kernels:
            continue
        with TemporaryDirectory() as made:
            error, slowdown = compare(path, law, given.rounds, Path(made))
        errors.append((path.stem, error))
        slowdowns.append((path.stem, slowdown))
        print(path.stem, flush=True)
    table("error of the estimated cycles", errors, ".0%")
    table("time over plain code", slowdowns, ".2f")


if __name__ == "__main__":
    main()
