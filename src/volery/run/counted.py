"""C++ components that count what they compute, compiled for the core that they are allocated to."""

from __future__ import annotations

import re
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from volery.components.cpp.build import one_by_one
from volery.components.cpp.meter import Counters, Worth
from volery.components.cpp.toolchain import Toolchain, cache_folder
from volery.cost import catalogue
from volery.cost.core import CoreLaw
from volery.model.system import CPP_LANGUAGES, Instance, System

Cycles = np.ndarray[Any, np.dtype[Any]]
"""Of each block."""

_OURS = re.compile(r'"?_ZNK?(?:6volery|3ros)')
"""Symbols of the border and of client libraries: what calls into these take has prices of its own."""

PER_CYCLE = 1000
"""Steps of a cycle: costs are whole numbers of them, so that sums are exact on every machine."""


def core_of(system: System, fidelity: str, instance: Instance) -> CoreLaw | None:
    """The core that the code of *instance* is counted for.

    ``None`` if it is not counted so: at another fidelity than ``code``, for other languages, where there is
    no processor, and where nothing is known of its core.
    """
    component = instance.component
    counts = fidelity == "code" and component.path and component.language in CPP_LANGUAGES
    if not counts or instance.processor is None:
        return None
    known = catalogue(*system.catalogues).processors.get(system.processor(instance.processor).kind)
    return None if known is None or known.core_model is None else known.core_law()


def ns_per_step(law: CoreLaw, frequency_mhz: float) -> float:
    """The time of a step on a core; ``EstimateError`` for a frequency outside the law's range."""
    law.check_frequency(frequency_mhz)
    return 1000.0 / frequency_mhz / PER_CYCLE


def options(include: Sequence[Path], flags: Sequence[str]) -> list[str]:
    """What the compiler of counted and traced code is told."""
    return ["-std=c++17", "-fPIC", *(option for path in include for option in ("-I", str(path))), *flags]


class Counting:
    """A ``Compile`` for a core at a frequency. What is compiled is kept as the compiler's own objects are."""

    def __init__(self, law: CoreLaw, frequency_mhz: float) -> None:
        self._law, self._mhz = law, frequency_mhz
        self._cycles: Cycles | None = None
        self.estimated = ""

    def __call__(
        self, tools: Toolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
    ) -> list[Path]:
        """One object that counts its blocks. What does not compile is told in the compiler's words first."""
        plain = one_by_one(tools, sources, include, flags)
        made = cache_folder() / f"{self._digest(plain)}.o"
        costs = made.with_suffix(".npz")
        if not (made.exists() and costs.exists()):
            if tools.tell is not None:
                tools.tell(f"counting {tools.component} on {self._law.name}")
            self._make(sources, include, flags, made)
        self._price(costs)
        return [made]

    def _price(self, costs: Path) -> None:
        """With the costs that were learnt meanwhile, or those that were found when it was compiled."""
        from volery.cost.native.store import kept_costs

        with np.load(costs) as found:
            learnt = kept_costs(str(found["key"]))
            cycles, memory = (found["cycles"], found["memory"])
            self.estimated = str(found["estimated"])
            if learnt is not None:
                cycles, memory, self.estimated = learnt.cycles, learnt.memory, ""
            self._cycles = (cycles + memory * self._mhz / 1000.0) * found["theirs"]

    def _digest(self, plain: Sequence[Path]) -> str:
        from volery.cost.native.program import METHOD

        contents = (sha256(one.read_bytes()).hexdigest() for one in plain)
        told = " ".join((METHOD, self._law.model_dump_json(), *contents))
        return sha256(told.encode()).hexdigest()[:32]

    def _make(
        self, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str], made: Path
    ) -> None:
        from volery.cost.native import instrument

        new = made.with_suffix(".new.o")
        found = instrument(sources, self._law, new, options(include, flags))
        costs = found.costs
        theirs = np.array([not _OURS.match(name) for name in found.functions])
        np.savez(
            made.with_suffix(".npz"),
            cycles=costs.cycles,
            memory=costs.memory,
            theirs=theirs,
            key=found.key,
            estimated=found.estimated,
        )
        new.replace(made)

    def worth(self) -> Worth:
        """What counts amount to in steps, once it has compiled. All numbers are whole: nothing is rounded."""
        assert self._cycles is not None
        steps = np.rint(self._cycles * PER_CYCLE).astype(np.int64)

        def worth(counters: Counters) -> int:
            return int((np.ctypeslib.as_array(counters).view(np.int64) * steps).sum())

        return worth
