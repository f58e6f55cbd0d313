"""Make src/volery/base/egm96.grid from EGM96's 5' grid, and say how far the two are apart.

Usage: scripts/egm96_grid.py EGM96-5.NPZ, the file in the PyPI package egm96 (0.3.0): second differences of
centimetres, from the south pole northwards and from 180 degrees west eastwards.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from volery.base.geoid import GRID_FILE
from volery.base.geoid_grid import Egm96Grid, pack

FINER = 3
"""5' in a quarter of a degree."""
TRIED = 40_000


def main(source: Path) -> None:
    """Write it."""
    steps = np.load(source)["undulation_d2"]
    metres = np.cumsum(np.cumsum(steps, axis=0, dtype=np.int64), axis=1) / 100.0
    coarse = np.round(metres[::FINER, :-1:FINER] * 10.0).astype(np.int16)
    target = Path(__file__).parents[1] / "src" / "volery" / "base" / GRID_FILE
    target.write_bytes(pack(coarse))
    grid, drawn = Egm96Grid(target.read_bytes()), np.random.default_rng(1)
    rows, columns = (drawn.integers(0, size, TRIED) for size in metres.shape)
    errors = np.array(
        [
            abs(grid.height(row / 12.0 - 90.0, column / 12.0 - 180.0) - metres[row, column])
            for row, column in zip(rows, columns, strict=True)
        ]
    )
    worst, usual, square = errors.max(), np.quantile(errors, 0.99), np.sqrt(np.mean(errors**2))
    print(f"{target}: {target.stat().st_size} bytes; off by at most {worst:.3f} m")
    print(f"at {TRIED} places of the 5' grid")
    print(f"99 %: {usual:.3f} m, root mean square: {square:.3f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
