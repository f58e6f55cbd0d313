"""A quadrotor as an FMU, of FMI 2 or 3, compiled from ``fmus/multirotor.c`` when a test asks for it."""

import shutil
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory
from zipfile import ZipFile

from rigs.requirements import lacking

SOURCE = Path(__file__).with_name("fmus") / "multirotor.c"
QUANTITIES: Mapping[str, tuple[int, str]] = {
    "commands": (4, "input"),
    "wind": (3, "input"),
    "ground": (1, "input"),
    "voltage": (1, "input"),
    "load": (1, "input"),
    "push": (3, "input"),
    "position": (3, "output"),
    "velocity": (3, "output"),
    "attitude": (4, "output"),
    "rates": (3, "output"),
    "rotor_speeds": (4, "output"),
    "fail_at": (1, "parameter"),
    "failure": (1, "parameter"),
}
CRASH, ERROR, NO_NUMBER, HANG, FALL = 1, 2, 3, 4, 5
"""Values of the parameter ``failure``."""


def make_fmu(
    file: Path,
    version: int = 2,
    *,
    frd: bool = False,
    names: Mapping[str, str] | None = None,
    without: tuple[str, ...] = (),
    kind: str = "CoSimulation",
    platform: str = "",
    fixed_step: float = 0.0,
    code: bool = True,
) -> Path:
    """Write an FMU and return its file.

    Args:
        file: The file to write.
        version: Version of FMI.
        frd: Whether its axes are forward, right, down.
        names: Other names of quantities.
        without: Quantities that it does not state.
        kind: ``CoSimulation`` or ``ModelExchange``.
        platform: Platform of its machine code; empty: this one.
        fixed_step: Internal step that it states [s]; 0: none.
        code: Whether it has machine code.
    """
    if find_spec("fmpy") is None:
        lacking("FMPy is not installed")
    import fmpy

    usual = fmpy.platform if version == 2 else fmpy.platform_tuple
    with ZipFile(file, "w") as archive:
        archive.writestr(
            "modelDescription.xml", _description(version, names or {}, without, kind, fixed_step)
        )
        if code:
            archive.writestr(f"binaries/{platform or usual}/quad.so", _machine_code(version, frd))
    return file


@cache
def _machine_code(version: int, frd: bool) -> bytes:
    """Return the compiled quadrotor. FMPy wants every function of the standard: those not called fail."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    if shutil.which("gcc") is None:
        lacking("there is no gcc")
    with TemporaryDirectory() as folder:
        rest, library = Path(folder, "rest.c"), Path(folder, "quad.so")
        functions = [name for name in dir(FMU2Slave if version == 2 else FMU3Slave) if name.startswith("fmi")]
        rest.write_text(
            "".join(f"__attribute__((weak)) int {one}(void) {{ return 3; }}\n" for one in functions)
        )
        flags = ["-shared", "-fPIC", "-O2", "-w", f"-DFMI_VERSION={version}", *(["-DFRD"] if frd else [])]
        headers = Path(fmpy.__file__).parent / "c-code"
        run(["gcc", *flags, f"-I{headers}", SOURCE, rest, "-o", library, "-lm"], check=True)
        return library.read_bytes()


def _description(
    version: int, names: Mapping[str, str], without: tuple[str, ...], kind: str, fixed_step: float
) -> str:
    lines: list[str] = []
    indices: list[int] = []
    place = 0
    for quantity, (width, causality) in QUANTITIES.items():
        name = names.get(quantity, quantity)
        variability = "fixed" if causality == "parameter" else "continuous"
        attributes = f'causality="{causality}" variability="{variability}"'
        needs_start = causality != "output"
        start = ' start="0"' if needs_start else ""
        if quantity in without:
            pass
        elif version == 3:
            start = f' start="{" ".join(["0"] * width)}"' if needs_start else ""
            dimension = f'<Dimension start="{width}"/>' if width > 1 else ""
            lines.append(
                f'<Float64 name="{name}" valueReference="{place}" {attributes}{start}>{dimension}</Float64>'
            )
            if causality == "output":
                indices.append(place)
        else:
            for part in range(width):
                scalar = f"{name}[{part + 1}]" if width > 1 else name
                lines.append(
                    f'<ScalarVariable name="{scalar}" valueReference="{place + part}" {attributes}>'
                    f"<Real{start}/></ScalarVariable>"
                )
                if causality == "output":
                    indices.append(len(lines))
        place += width
    variables = "\n".join(lines)
    if version == 3:
        structure = "".join(f'<Output valueReference="{one}"/>' for one in indices)
        fixed = f' fixedInternalStepSize="{fixed_step}"' if fixed_step else ""
        variables += (
            '<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>'
        )
        head = 'fmiVersion="3.0" modelName="quad" instantiationToken="q"'
        return (
            f'<?xml version="1.0"?><fmiModelDescription {head}><{kind} modelIdentifier="quad"{fixed}/>'
            f"<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
            "</fmiModelDescription>"
        )
    outputs = "".join(f'<Unknown index="{one}"/>' for one in indices)
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="quad" guid="q">'
        f'<{kind} modelIdentifier="quad"/><ModelVariables>{variables}</ModelVariables>'
        f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
    )
