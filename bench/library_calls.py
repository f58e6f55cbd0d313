"""What Python programs that use libraries take by the table of library calls, and when they run.

The programs in ``bench/library_programs`` take no part in the measurement of the table. As a reference the
same programs are estimated without the table: then a library call takes no time.

    python bench/library_calls.py [--unseen] [program ...]

With --unseen the programs of ``bench/unseen_library_programs``, written when the table was finished.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import mean, median

from volery.calibration.timed_code import Rounds, TimedCode, measure, timed_program, timed_programs
from volery.cost import library_table, operation_table

PROGRAMS = Path(__file__).with_name("library_programs")
UNSEEN = Path(__file__).with_name("unseen_library_programs")
SEED = 5


def shipped_ns(one: TimedCode) -> float:
    """Time by the tables that come with volery, on their machine."""
    return one.counted_ns(operation_table().nanoseconds, library_table())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--unseen", action="store_true")
    parser.add_argument("programs", nargs="*", metavar="program", help="by default all of the folder")
    wanted = parser.parse_args()
    folder = UNSEEN if wanted.unseen else PROGRAMS
    files = [folder / f"{name}.py" for name in wanted.programs] or sorted(folder.glob("*.py"))
    programs = [timed_program(file.stem, file.read_text(), SEED) for file in files]
    own = timed_programs()
    measure([*own, *programs], Rounds(9, 15, 0.03))
    slowdown = median(one.median / shipped_ns(one) for one in own)
    print(f"this machine against that of the tables: {slowdown:.2f}")
    print(f"{'':16}{'measured':>12}{'estimate':>12}{'error':>8}{'without':>12}{'error':>8}")
    errors = []
    for one in programs:
        whole = shipped_ns(one) * slowdown
        without = one.counted_ns(operation_table().nanoseconds) * slowdown
        errors.append(abs(whole / one.median - 1.0))
        print(
            f"{one.name:16}{one.median / 1e6:9.3f} ms{whole / 1e6:9.3f} ms{whole / one.median - 1.0:+8.1%}"
            f"{without / 1e6:9.3f} ms{without / one.median - 1.0:+8.1%}"
        )
    print(f"mean error {mean(errors):.1%}, worst {max(errors):.1%}")


if __name__ == "__main__":
    main()
