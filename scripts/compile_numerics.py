"""Compile the entry points of machine code into src/volery/base/object_code, for the architecture at hand.

A wheel that is built afterwards carries the object code; ``VOLERY_COMPILE=1 pip wheel .`` runs this as well.
The code is for the oldest processor of the architecture and gives the bits that numba's gives. Needs numba,
and a C compiler as linker.

    python scripts/compile_numerics.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ["NUMBA_CPU_NAME"] = "generic"
os.environ["NUMBA_CPU_FEATURES"] = ""

sys.path.insert(0, str(Path(__file__).parent.parent / "src"))
import llvmlite.binding as llvm
from numba import carray, cfunc, types  # type: ignore[attr-defined]  # numba does not declare carray

from volery.autonomy.avoidance import judge_candidates
from volery.autonomy.grid_path import spread_ways
from volery.autonomy.occupancy_grid import mark_beams
from volery.autonomy.scan_matching import align_lines, bound_blocks, search_blocks, spread_likelihood
from volery.base.numeric_code import NumericCode, parsed
from volery.cost.native.core_model import execute_blocks
from volery.simulation.added_sensors.beams import cast_beams
from volery.simulation.autopilots.flight_stack.flight_step import advance_flights
from volery.simulation.autopilots.px4.loop_step import fly_px4_loops
from volery.simulation.world.body_step import advance_bodies
from volery.simulation.world.rasteriser import draw_picture

ENTRY_POINTS = (
    *(advance_flights, advance_bodies, fly_px4_loops, cast_beams, draw_picture, execute_blocks),
    *(judge_candidates, mark_beams, spread_ways, spread_likelihood, bound_blocks, search_blocks, align_lines),
)

ERROR_PATHS = """
/* What numba's code calls where it raises an error; none does, since a division by zero gives an infinity. */
#define NOTHING(name) __attribute__((visibility("hidden"))) void *name(void) { return 0; }
#define NO_ERROR(name) __attribute__((visibility("hidden"))) void *name;
NOTHING(NRT_Free) NOTHING(NRT_MemInfo_call_dtor) NOTHING(PyBytes_FromStringAndSize) NOTHING(PyErr_Clear)
NOTHING(PyErr_SetNone) NOTHING(PyErr_SetString) NOTHING(PyErr_WriteUnraisable) NOTHING(PyUnicode_FromString)
NOTHING(Py_DecRef) NOTHING(numba_do_raise) NOTHING(numba_gil_ensure) NOTHING(numba_gil_release)
NOTHING(numba_runtime_build_excinfo_struct) NOTHING(numba_unpickle)
NO_ERROR(PyExc_RuntimeError) NO_ERROR(PyExc_StopIteration) NO_ERROR(PyExc_SystemError)
"""


ENTRY = """
typedef union {{ long long integer; double number; }} word;
extern __attribute__((visibility("hidden"))) long long {name}_on({types});
long long {name}(const word *block) {{ return {name}_on({words}); }}
"""
"""The exported function: it takes its arguments from a block of words, since a call of one is cheaper."""


def compiled(entry: NumericCode) -> tuple[bytes, str]:
    """Return an entry point as a relocatable object, and the C source of the function that is exported."""
    parameters, values = [], []
    kinds: list[Any] = []
    for index, argument in enumerate(entry.arguments):
        kind, dimensions = parsed(argument)
        sizes = [f"n{index}_{axis}" for axis in range(dimensions)]
        parameters += [f"a{index}", *sizes]
        values.append(f"carray(a{index}, ({', '.join(sizes)},))" if sizes else f"a{index}")
        number = getattr(types, kind)
        kinds += [types.CPointer(number) if dimensions else number, *[types.int64] * dimensions]
    numbers = [kind == types.float64 for kind in kinds]
    source = ENTRY.format(
        name=entry.name,
        types=", ".join("double" if number else "long long" for number in numbers),
        words=", ".join(
            f"block[{at}].{'number' if number else 'integer'}" for at, number in enumerate(numbers)
        ),
    )
    scope: dict[str, Any] = {"carray": carray, "entry": entry.by_numba(cache=False)}
    exec(f"def call({', '.join(parameters)}):\n    return entry({', '.join(values)})\n", scope)
    made: Any = cfunc(types.int64(*kinds))(scope["call"])
    name = f"{entry.name}_on"
    text = str(made._library._final_module).replace(made._wrapper_name, name)
    return _optimised(llvm.parse_assembly(text), name), source


def _optimised(module: Any, entry: str) -> bytes:
    """Optimise once more with all functions but one private to the module: that permits to inline them."""
    target = llvm.Target.from_default_triple().create_target_machine(
        "generic", "", opt=3, reloc="pic", codemodel="small"
    )
    for function in module.functions:
        if not function.is_declaration and function.name != entry:
            function.linkage = "internal"
    passes = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(module, passes)
    code: bytes = target.emit_object(module)
    return code


def build(entry: NumericCode, linker: str) -> None:
    """Compile one entry point, unless its object code is up to date, and remove its older object code."""
    folder = entry.library.parent
    folder.mkdir(exist_ok=True)
    for old in folder.glob(f"{entry.name}-*.so"):
        if old != entry.library:
            old.unlink()
    if entry.shipped:
        return
    with tempfile.TemporaryDirectory(dir=folder) as place:  # renamed when whole: others load meanwhile
        file = Path(place) / "code.o"
        code, source = compiled(entry)
        file.write_bytes(code)
        frame = Path(place) / "frame.c"
        frame.write_text(ERROR_PATHS + source)
        made = Path(place) / "code.so"
        options = ["-shared", "-fPIC", "-s", "-Wl,--no-undefined", "-fno-builtin", "-o", str(made)]
        subprocess.run([linker, *options, str(file), str(frame), "-lm"], check=True)
        made.replace(entry.library)
    print(f"{entry.library.name}: {entry.library.stat().st_size} bytes")


def find_linker() -> str:
    """Return the C compiler that links; exit if there is none."""
    for name in ("cc", "gcc", "g++", "clang", "clang-19"):
        if path := shutil.which(name):
            return path
    sys.exit("compile_numerics: there is no C compiler to link with; install gcc or clang")


def main() -> None:
    """Compile all entry points."""
    linker = find_linker()
    for entry in ENTRY_POINTS:
        build(entry, linker)


if __name__ == "__main__":
    main()
