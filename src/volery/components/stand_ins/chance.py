"""``random`` with a named stream for each component, seeded from the run's seed."""

from __future__ import annotations

import random as real_random
from types import ModuleType
from typing import Any

from volery.base.seeds import stream
from volery.components.stand_ins.module import make_module
from volery.kernel.api import Kernel

_DRAWS = (
    "betavariate",
    "binomialvariate",
    "choice",
    "choices",
    "expovariate",
    "gammavariate",
    "gauss",
    "getrandbits",
    "getstate",
    "lognormvariate",
    "normalvariate",
    "paretovariate",
    "randbytes",
    "randint",
    "random",
    "randrange",
    "sample",
    "seed",
    "setstate",
    "shuffle",
    "triangular",
    "uniform",
    "vonmisesvariate",
    "weibullvariate",
)


class _Streams:
    """One stream a component, made when it first draws. Who draws is read from the flow of control."""

    def __init__(self, kernel: Kernel, seed: int) -> None:
        self._kernel = kernel
        self._seed = seed
        self._streams: dict[str, real_random.Random] = {}

    def mine(self) -> real_random.Random:
        task = self._kernel.current()
        component = task.place.component if task is not None else ""
        if component not in self._streams:
            self._streams[component] = stream(self._seed, f"component {component}")
        return self._streams[component]


def random_module(kernel: Kernel, seed: int) -> ModuleType:
    """Stands in for ``random``. ``Random()`` without a seed takes one from the component's stream."""
    streams = _Streams(kernel, seed)

    class Random(real_random.Random):
        def __init__(self, x: Any = None) -> None:
            super().__init__(streams.mine().getrandbits(64) if x is None else x)

    def draw(name: str) -> Any:
        def drawn(*args: Any, **kwargs: Any) -> Any:
            return getattr(streams.mine(), name)(*args, **kwargs)

        drawn.__name__ = name
        return drawn

    names: dict[str, Any] = {name: draw(name) for name in _DRAWS if hasattr(real_random.Random, name)}
    return make_module("random", {**names, "Random": Random, "SystemRandom": Random})
