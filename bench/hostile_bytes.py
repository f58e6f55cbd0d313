"""What spoiled frames cost and leave behind: 10^6 of them through parser and driver, for each driver.

Reference: the memory after 2*10^5 frames. The frames are made of recorded ones (Paparazzi's: of every message
that is known) by a seeded mutator; a program goes on flying by what they say.

    python bench/hostile_bytes.py [--quick]
"""

from __future__ import annotations

import argparse
import sys
import tracemalloc
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "properties"))
from test_hostile_bytes import EARLY, MANY, SOME, Growth, frames_for

from volery.testing.fuzzing import fuzz

DRIVERS = ("ardupilot", "px4", "paparazzi")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a fifth of the frames")
    count = SOME if parser.parse_args().quick else MANY
    for driver in DRIVERS:
        frames = frames_for(driver)
        start = process_time()
        campaign = fuzz(driver, frames, SOME)
        each = (process_time() - start) / SOME
        growth = Growth(count)
        tracemalloc.start()
        fuzz(driver, frames, count, after=growth.look)
        tracemalloc.stop()
        kept = growth.late - growth.early
        print(
            f"{driver:10} {1e6 * each:5.1f} us a frame, {campaign.received / campaign.fed:4.0%} decoded, "
            f"from {count // EARLY} to {count} frames {kept / 1e3:+.0f} kB "
            f"({growth.late / growth.early:.2f} x)"
        )


if __name__ == "__main__":
    main()
