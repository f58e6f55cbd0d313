"""A body that an FMU moves beside volery's own body, and beside a bare loop over the same FMU.

    python bench/fmu.py [FMU]

The bare loop gives the FMU the same inputs at each step, in its process, without a world. By default the FMU
is the quadrotor of the tests, which is compiled.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.model.fmu_bodies import Fmu
from volery.simulation.autopilots.flight_stack.flight import Flight, make_world
from volery.simulation.fmu.fmu_body import FmuBody
from volery.simulation.fmu.fmu_interface import read_interface
from volery.simulation.fmu.running_fmu import RunningFmu
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.world import STEP

ROUNDS, SECONDS = 5, 4
READ_EVERY = S // 50


def _per_step(act: Callable[[], None]) -> float:
    """Return the shortest time of a step [us]."""
    times = []
    for _ in range(ROUNDS):
        start = perf_counter()
        act()
        times.append(perf_counter() - start)
    return 1e6 * min(times) * STEP / (SECONDS * S)


class Hover:
    """A body in a world of its own."""

    def __init__(self, moved: FmuBody | None) -> None:
        self._now = 0
        spec = Multirotor() if moved is None else moved.spec
        frame = LocalFrame(47.0, 8.0, 400.0)
        flights: list[Flight]
        _, flights = make_world(lambda: self._now, [spec], seed=1, frame=frame)
        self._flight = flights[0]
        if moved is not None:
            moved.begin(self._flight.row)
            self._flight.move_by(moved)

    def fly(self) -> None:
        """Let time pass, read 50 times a second."""
        for _ in range(SECONDS * S // READ_EVERY):
            self._now += READ_EVERY
            self._flight.truth()


def main() -> None:
    """Print the times of a step and their ratios."""
    with TemporaryDirectory() as folder:
        if len(sys.argv) > 1:
            file = Path(sys.argv[1])
        else:
            sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
            from rigs.multirotor_fmu import make_fmu  # noqa: PLC0415  # of the tests

            file = make_fmu(Path(folder, "quad.fmu"))
        interface = read_interface(Fmu(file), len(Multirotor().rotors))
        bare, moving = (RunningFmu(name, interface, Path(folder, name)) for name in ("bare", "moving"))
        try:
            inputs = [0.0] * interface.inputs.size
            bare.exchange(inputs)

            def loop() -> None:
                for _ in range(SECONDS * S // STEP):
                    bare.exchange(inputs)

            own = _per_step(Hover(None).fly)
            alone = _per_step(loop)
            moved = _per_step(Hover(FmuBody(moving, Multirotor(), "flu")).fly)
        finally:
            bare.close()
            moving.close()
    print(f"volery's own body {own:.1f} us a step; bare loop over the FMU {alone:.1f} us")
    print(
        f"moved by the FMU {moved:.1f} us: {moved / alone:.2f} of the bare loop, {moved / own:.0f} of its own"
    )


if __name__ == "__main__":
    main()
