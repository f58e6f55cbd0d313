"""CPU time of the delivery among 1,000 walls, beside the same service on open ground.

The walls hang above the ways of the vehicles, so both runs fly alike and each step asks for walls nearby; the
rounds alternate. The goal is a ratio of 1.05.

    python bench/walls.py [--rounds 3]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from time import process_time

from volery import Options, simulate
from volery.model.environment import Prism
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

MODEL = Path(__file__).parents[1] / "examples" / "delivery"
WALLS = 1000


def walls() -> tuple[Prism, ...]:
    """Return walls of 10 m in rows all over the city, from 200 m up."""
    found = []
    for index in range(WALLS):
        east, north = -200.0 + 12.0 * (index % 50), -200.0 + 25.0 * (index // 50)
        corners = tuple((east + x, north + y) for x, y in ((0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (0.0, 1.0)))
        found.append(Prism(f"wall_{index}", corners, 200.0, 220.0))
    return tuple(found)


def once(buildings: tuple[Prism, ...]) -> float:
    """Return the CPU seconds of a run."""
    system = load(MODEL, vocabulary(), scenario="pocket")
    world = replace(system.environment, buildings=buildings)
    start = process_time()
    simulate(replace(system, environment=world), Options(out=None))
    return process_time() - start


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    once(())
    found = [(once(()), once(walls())) for _ in range(rounds)]
    bare, among = (min(column) for column in zip(*found, strict=True))
    print(f"open ground {bare:.2f} s, among {WALLS} walls {among:.2f} s of CPU time: {among / bare:.3f}")


if __name__ == "__main__":
    main()
