"""How fast loops without a sleep are simulated: virtual seconds a second of processor time of this machine.

A vehicle's computer executes such a loop at 1. Each loop is a node of its own, run in a model without
processors (``free``), with stated times (``times``) and with counted code (``code``). Figures are the best of
several runs.

    python bench/polling.py [VIRTUAL SECONDS]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import volery

LIBRARIES = {
    "rospy": ("import rospy\nrospy.init_node('busy')\n", "not rospy.is_shutdown()"),
    "rclpy": ("import rclpy\nrclpy.init()\nnode = rclpy.create_node('busy')\n", "rclpy.ok()"),
}
BODIES = {
    "empty": "    pass\n",
    "adds": "    turns += 1\n",
    "computes": "    turns += 1\n    compute()\n",
    "sums 200": "    total = 0\n    for number in range(200): total += number * number\n",
}
COMPUTE = """
turns = 0
state = {"n": 0, "x": 0.0}
def compute():
    state["n"] += 1
    state["x"] = 0.9 * state["x"] + 0.1 * (state["n"] % 7)
"""
PROCESSOR = "intel-i5-3470, frequency: 3000 MHz"
PLATFORM = f"""
application: {{busy: {{is: Busy}}}}
platform: {{processors: {{host: {{is: {PROCESSOR}}}}}}}
allocations: {{only: {{busy: host}}}}
environment: {{origin: {{latitude: 43.47, longitude: -3.8}}}}
"""
FREE = "\nenvironment: {origin: {latitude: 43.47, longitude: -3.8}, components: {busy: {is: Busy}}}\n"
MODELS = {"free": ("times", FREE), "times": ("times", PLATFORM), "code": ("code", PLATFORM)}
RUNS = 3


def taken(library: str, body: str, model: str, seconds: float) -> float:
    """Return the processor time of one run, s."""
    head, test = LIBRARIES[library]
    fidelity, rest = MODELS[model]
    at = f", at: {{processor: {PROCESSOR}}}, activation: {{time: 0.1 ms}}" if rest is PLATFORM else ""
    component = f"components: {{Busy: {{language: {library}, path: busy.py, active: true{at}}}}}"
    with TemporaryDirectory() as folder:
        Path(folder, "busy.py").write_text(f"{head}{COMPUTE}while {test}:\n{BODIES[body]}")
        text = f"volery: 1\nname: polling\n{component}{rest}run: {{duration: {seconds} s}}\n"
        Path(folder, "model.yaml").write_text(text)
        before = time.process_time()
        volery.simulate(folder, volery.Options(fidelity=fidelity))
        return time.process_time() - before


def main() -> None:
    """Measure and print."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 0.1
    taken("rospy", "empty", "free", seconds)  # imports
    print(f"{'':<18}" + "".join(f"{model:>8}" for model in MODELS))
    for library in LIBRARIES:
        for body in BODIES:
            ratios = []
            for model in MODELS:
                start = min(taken(library, body, model, 0.001) for _ in range(RUNS))
                whole = min(taken(library, body, model, seconds) for _ in range(RUNS))
                ratios.append((seconds - 0.001) / max(whole - start, 1e-9))
            print(f"{library} {body:<12}" + "".join(f"{one:>8.2f}" for one in ratios), flush=True)


if __name__ == "__main__":
    main()
