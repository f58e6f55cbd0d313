"""What programs in Python take by their counted operations, and what they take when they run.

The twelve programs in ``bench/python_programs`` were written before any cost was calibrated, and take no part
in calibrating. In one campaign the calibration's own statements and programs are timed, round about, with the
twelve as they are and the twelve with counters in them. ``fresh`` is by the costs of this very campaign,
``shipped`` by the table that comes with volery, times how much slower this machine is by the calibration's
programs. No cost is fitted to the twelve, but the classes of operations were chosen after a first look.

    python bench/python_code.py [MOST ROUNDS]
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import mean

from volery.calibration.operation_costs import calibrate
from volery.calibration.timed_code import Rounds, TimedCode, timed_program
from volery.cost.instrumentation import StepCounter
from volery.cost.python_operations import operation_table

PROGRAMS = Path(__file__).with_name("python_programs")
SEED = 5


def counted(one: TimedCode) -> TimedCode:
    """The same with counters in it."""
    return TimedCode(one.name, one.text, lambda _: one.load(StepCounter()))


def main() -> None:
    rounds = Rounds(9, int(sys.argv[1]) if len(sys.argv) > 1 else 15)
    plain = [timed_program(file.stem, file.read_text(), SEED) for file in sorted(PROGRAMS.glob("*.py"))]
    with_counters = [counted(one) for one in plain]
    found = calibrate(rounds, beside=[*plain, *with_counters])
    table = operation_table()
    print(f"this machine against that of the table: {found.slowdown:.2f} ± {found.slowdown_spread:.0%}")
    print(f"operations take {found.in_context:.2f} times as long in programs as in loops of one statement")
    print(
        f"{'':16}{'measured':>11}{'spread':>8}{'fresh':>11}{'error':>8}{'shipped':>11}{'error':>8}{'slower':>8}"
    )
    fresh, shipped = [], []
    for one, slowed in zip(plain, with_counters, strict=True):
        by_fresh = one.counted_ns(found.costs)
        by_shipped = one.counted_ns(table.nanoseconds) * found.slowdown
        fresh.append(by_fresh / one.median - 1.0)
        shipped.append(by_shipped / one.median - 1.0)
        print(
            f"{one.name:16}{one.median / 1e6:8.3f} ms{one.spread:8.1%}"
            f"{by_fresh / 1e6:8.3f} ms{fresh[-1]:+8.1%}{by_shipped / 1e6:8.3f} ms{shipped[-1]:+8.1%}"
            f"{slowed.median / one.median:8.2f}"
        )
    for name, errors in (("fresh", fresh), ("shipped", shipped)):
        sizes = [abs(error) for error in errors]
        print(f"{name}: mean error {mean(sizes):.1%}, worst {max(sizes):.1%}")
    factors = [slowed.median / one.median for one, slowed in zip(plain, with_counters, strict=True)]
    print(f"counting makes code {sorted(factors)[len(factors) // 2]:.2f} times slower (median)")


if __name__ == "__main__":
    main()
