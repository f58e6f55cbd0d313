"""C++ components that tell which blocks of their code they enter, for the core that they are allocated to."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from volery.components.cpp.build import one_by_one
from volery.components.cpp.library import Library
from volery.components.cpp.toolchain import Toolchain, cache_folder
from volery.cost.core import CoreLaw
from volery.run.counted import options

if TYPE_CHECKING:
    from volery.cost.native.program import Program

WINDOW, STRIDE = 1024, 4096
"""Blocks that are told of so many: a run may enter billions."""


class Tracing:
    """A ``Compile`` for a core. ``program`` is what was compiled."""

    def __init__(self, law: CoreLaw) -> None:
        self.law = law
        self.program: Program | None = None

    def __call__(
        self, tools: Toolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
    ) -> list[Path]:
        """One object that tells, and what it tells it to. The compiler's own words come first."""
        from volery.cost.native.program import compile_program
        from volery.cost.native.running import runtime_objects

        one_by_one(tools, sources, include, flags)
        self.program = compile_program(sources, self.law, options(include, flags))
        with TemporaryDirectory(dir=cache_folder()) as scratch:
            code = Path(scratch, "code.o")
            self.program.traced_object(code)
            made = [code, *runtime_objects(Path(scratch))]
            kept = [cache_folder() / f"{self.program.key}.{one.name}" for one in made]
            for one, place in zip(made, kept, strict=True):
                one.replace(place)
        return kept

    def begin(self, library: Library, file: Path) -> None:
        """Have a library that was compiled so tell it to *file*, until its ``volery_end`` is called."""
        from volery.cost.native.running import in_words

        library.function("volery_model_caches")(in_words(self.law.memory).encode())
        each, of = ctypes.c_uint64(WINDOW), ctypes.c_uint64(STRIDE)
        library.function("volery_trace_into")(str(file).encode(), each, of)
