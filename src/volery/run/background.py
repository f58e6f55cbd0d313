"""What else runs on a computer: the model's ``load``, a share of each core that components do not get.

It is more urgent than any component, as interrupts and a reserved share are, and comes in pieces: one each
``PERIOD`` and core, of the stated share of it on average. How the pieces differ is seeded, so the same run
has the same load, whatever runs on the machine that simulates it.
"""

from __future__ import annotations

from functools import partial

from volery.base.seeds import stream
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.kernel.processor import Processor
from volery.kernel.task import Place
from volery.model.system import Processor as ProcessorModel

PERIOD: Ns = 10 * MS
URGENT = 1 << 30
"""Above the priority of any component."""
UNEVEN = 0.5
"""By so much of what it may be, a piece is shorter or longer than the share of a period."""


def load_name(processor: str) -> str:
    """Under this name its computing stands among the components."""
    return f"{processor} (load)"


def occupy(kernel: Kernel, processor: Processor, model: ProcessorModel, seed: int) -> None:
    """Let the load of *model*, if it has one, run on *processor*; core after core begins within a period."""
    if model.load <= 0.0:
        return
    for core in range(model.cores):
        place = Place(load_name(model.name), processor, URGENT)
        pieces = _Pieces(kernel, processor, place, model.load, seed, core)
        kernel.call_at(kernel.now() + PERIOD * core // model.cores, pieces.begin)


class _Pieces:
    """The load of one core."""

    def __init__(
        self, kernel: Kernel, processor: Processor, place: Place, share: float, seed: int, core: int
    ) -> None:
        self._kernel = kernel
        self._run = partial(processor.load, place)
        self._mean = share * PERIOD
        self._most_off = UNEVEN * min(share, 1.0 - share) * PERIOD
        self._random = stream(seed, f"load/{processor.name}/{core}")

    def begin(self) -> None:
        """From now on, each period."""
        self._kernel.every(PERIOD, self._piece)

    def _piece(self) -> None:
        self._run(round(self._mean + self._random.uniform(-self._most_off, self._most_off)))
