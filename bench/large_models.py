"""How the work on a model grows with its size: seconds and memory, and the ratio to a tenth of it.

python bench/large_models.py [INSTANCES]
"""

from __future__ import annotations

import gc
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from volery.analysis.system_analysis import analyse
from volery.checks.findings import check
from volery.drawing.deployment import deployment_svg
from volery.drawing.shapes import functional_svg
from volery.exchange.uml.uml_model import export_uml, import_uml
from volery.model.assembly import read_tree
from volery.model.differences import differences
from volery.model.system import System
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

CHAIN = 5
"""Instances on each computer: one calls the next."""


def text(instances: int) -> str:
    """Return a model with computers of CHAIN instances, all on one network."""
    at = "at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}, activation: {time: 1 ms}"
    computers = range(max(2, instances // CHAIN))
    lines = [
        "volery: 1",
        "name: large",
        "interfaces: {Step: {go: }}",
        "components:",
        f"  Head: {{language: python, {at}, active: {{period: 50 ms}}, requires: {{to: Step}}, "
        "calls: {activation: {to.go: 1}}}",
        f"  Link: {{language: python, {at}, provides: {{step: Step}}, requires: {{to: Step}}, "
        "operations: {go: {time: 1 ms}}, calls: {go: {to.go: 1}}}",
        f"  Tail: {{language: python, {at}, provides: {{step: Step}}, operations: {{go: {{time: 1 ms}}}}}}",
        "application:",
    ]
    for one in computers:
        lines.append(f"  s{one}_0: {{is: Head, to: s{one}_1.step}}")
        lines += [f"  s{one}_{n}: {{is: Link, to: s{one}_{n + 1}.step}}" for n in range(1, CHAIN - 1)]
        lines.append(f"  s{one}_{CHAIN - 1}: {{is: Tail}}")
    lines.append("platform:\n  processors:")
    lines += [f"    pc{one}: {{is: rpi4-cortex-a72, frequency: 1500 MHz}}" for one in computers]
    joined = ", ".join(f"pc{one}" for one in computers)
    lines.append(f"  networks: {{net: {{between: [{joined}], bandwidth: 1 Gbit/s}}}}")
    lines.append("allocations:\n  one:")
    lines += [f"    s{one}_{n}: pc{one}" for one in computers for n in range(CHAIN)]
    return "\n".join(lines) + "\n"


def measured(work: Callable[[], object]) -> tuple[float, float]:
    """Return the seconds of *work*, and the MB that it allocates at most, in a second execution."""
    gc.collect()
    began = time.perf_counter()
    work()
    took = time.perf_counter() - began
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return took, peak / 1e6


def main() -> None:
    """Measure each work on a tenth of the model and on all of it."""
    size = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    print(f"{'':12} {'instances':>9} {'s':>8} {'MB':>8} {'ratio of s':>11}")
    results: dict[str, float] = {}
    for instances in (size // 10, size):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "model.yaml"
            file.write_text(text(instances))
            system = load(file, vocabulary())
            tree = read_tree(file).plain()
            uml = export_uml(tree, "large.uml")[0].encode()
            works: dict[str, Callable[[], object]] = {
                "load": lambda file=file: load(file, vocabulary()),
                "check": lambda file=file: check(file, vocabulary()),
                "export": lambda tree=tree: export_uml(tree, "large.uml"),
                "import": lambda uml=uml: import_uml(uml, "large.uml"),
                "functional": lambda system=system: functional_svg(system),
                "deployment": lambda system=system: deployment_svg(system),
                "analyse": lambda system=system: analyse(system),
                "diff": lambda system=system: differences(system, _changed(system)),
            }
            for name, work in works.items():
                took, peak = measured(work)
                ratio = f"{took / results[name]:.1f}" if name in results else ""
                results[name] = took
                print(f"{name:12} {len(system.instances):9} {took:8.3f} {peak:8.1f} {ratio:>11}")


def _changed(system: System) -> System:
    return replace(system, description="changed")


if __name__ == "__main__":
    main()
