"""What Python programs that use libraries take by the table of library calls, and when they run.

The programs in ``bench/library_programs`` take no part in the measurement of the table. As a reference the
same programs are estimated without the table: then a library call takes no time.

    python bench/library_calls.py [--unseen | --perception] [program ...]

With --unseen the programs of ``bench/unseen_library_programs``, written when the table was finished; with
--perception those of ``bench/perception_programs``: maps, paths, markers, pictures, clouds. Programs whose
library is not installed are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import mean, median

from volery.calibration.picture_times import module_if_installed
from volery.calibration.timed_code import Rounds, TimedCode, measure, timed_program, timed_programs
from volery.cost import library_table, operation_table

PROGRAMS = Path(__file__).with_name("library_programs")
UNSEEN = Path(__file__).with_name("unseen_library_programs")
PERCEPTION = Path(__file__).with_name("perception_programs")
OPTIONAL = ("gtsam", "small_gicp")
SEED = 5


def shipped_ns(one: TimedCode) -> float:
    """Time by the tables that come with volery, on their machine."""
    return one.counted_ns(operation_table().nanoseconds, library_table())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--unseen", action="store_true")
    which.add_argument("--perception", action="store_true")
    parser.add_argument("programs", nargs="*", metavar="program", help="by default all of the folder")
    wanted = parser.parse_args()
    folder = UNSEEN if wanted.unseen else PERCEPTION if wanted.perception else PROGRAMS
    files = [folder / f"{name}.py" for name in wanted.programs] or sorted(folder.glob("*.py"))
    missing = [f"import {name}" for name in OPTIONAL if module_if_installed(name) is None]
    texts = {file.stem: file.read_text() for file in files}
    programs = [
        timed_program(name, text, SEED)
        for name, text in texts.items()
        if not any(one in text for one in missing)
    ]
    pictures = module_if_installed("cv2")
    if pictures is not None:
        pictures.setNumThreads(1)
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
