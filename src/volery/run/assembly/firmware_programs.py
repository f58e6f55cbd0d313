"""The programs of real firmware that fly vehicles of a run: which they are, where they run, what is theirs.

A program is searched when a run starts, or a model is checked. Each runs in a folder of its own, in the run
folder or in a temporary one.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.base.errors import UsageError, choices
from volery.model.environment import FirmwareProgram, VehicleSpec
from volery.run.assembly.moved_bodies import check_body
from volery.run.result import Tell
from volery.simulation.autopilots.fleet_autopilot import AutopilotFamily, firmwares
from volery.simulation.real_firmware.family import PROJECTS, RealFirmwareFamily
from volery.simulation.real_firmware.firmware_process import CONSOLE_FILE
from volery.simulation.real_firmware.lock_step import RealFirmware
from volery.simulation.real_firmware.program_search import NOT_IN_STEP, PROGRAMS, find_program
from volery.vehicles.parameters import read_parameter_file

FOLDER, BODIES = "firmware", "bodies"
"""Folders of firmware and of FMUs in a run folder; each program has one in it, named after its vehicle."""


def usual_firmware(autopilot: str, kind: str) -> FirmwareProgram | None:
    """Return the usual program of a project for a kind of vehicle; None if there is none."""
    program = PROGRAMS[autopilot].programs.get(kind) if autopilot in PROJECTS else None
    return FirmwareProgram(program) if program else None


def on_real_firmware(vehicles: Iterable[VehicleSpec]) -> tuple[VehicleSpec, ...]:
    """Return the vehicles, each on a real program if its project has one for its kind.

    A program has a version and features of its own, so those that are stated are left out.
    """
    return tuple(
        vehicle
        if vehicle.firmware or (usual := usual_firmware(vehicle.autopilot, vehicle.kind)) is None
        else replace(vehicle, firmware=usual, version="", features="")
        for vehicle in vehicles
    )


class ProgramFolder:
    """Where the programs of a run have their folders.

    Args:
        run_folder: The run folder; None: a temporary folder that is removed at the end.
        tell: Receives a line before a program starts.
    """

    def __init__(self, run_folder: Path | None = None, tell: Tell | None = None) -> None:
        self._run_folder, self._tell = run_folder, tell
        self._temporary: TemporaryDirectory[str] | None = None

    @property
    def path(self) -> Path:
        """The folder of firmware."""
        return self._root / FOLDER

    @property
    def bodies(self) -> Path:
        """The folder of the FMUs that move bodies."""
        return self._root / BODIES

    @property
    def _root(self) -> Path:
        if self._run_folder is not None:
            return self._run_folder.absolute()
        if self._temporary is None:
            self._temporary = TemporaryDirectory(prefix="volery-programs-", ignore_cleanup_errors=True)
        return Path(self._temporary.name)

    def prepare(self, vehicle: VehicleSpec) -> None:
        """Say that a program boots, and remove what one of an earlier run has left, which it would remember.

        Raises:
            UsageError: It cannot be removed.
        """
        assert vehicle.firmware is not None
        if self._tell is not None:
            self._tell(f"{vehicle.name}: {Path(vehicle.firmware.program).name} boots")
        left = self.path / vehicle.name
        if (left / CONSOLE_FILE).exists():
            try:
                shutil.rmtree(left)
            except OSError as error:
                raise UsageError(f"cannot remove {left} of an earlier run: {error.strerror}") from error

    def close(self) -> None:
        """Remove a temporary folder."""
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None


def family_of(vehicle: VehicleSpec, programs: ProgramFolder, seed: int = 0) -> AutopilotFamily:
    """Return the family of the autopilot of a vehicle: a program of real firmware, or a simulated one.

    Args:
        vehicle: The vehicle.
        programs: Where its program has its folder.
        seed: Seed of the run.

    Raises:
        UsageError: There is no such version, feature, link or program. The text does not name the vehicle.
    """
    firmware = vehicle.firmware
    if firmware is None:
        simulated = firmwares.load(vehicle.autopilot).of_version(vehicle.version)
        return simulated.with_features(vehicle.features)
    if vehicle.autopilot not in PROJECTS:
        reason = NOT_IN_STEP.get(vehicle.autopilot, "nothing links it to the simulated world")
        raise UsageError(
            f"real firmware of {vehicle.autopilot} does not fly in virtual time: {reason}; real firmware "
            f"that does is that of {choices(PROJECTS)}"
        )
    return RealFirmwareFamily(
        name=vehicle.autopilot,
        program=find_program(firmware.program),
        folder=programs.path,
        repeatable=firmware.repeatable,
        seed=seed,
    )


def parameters_of(vehicle: VehicleSpec) -> Mapping[str, float]:
    """Return the parameters of a vehicle: those of its files, below its own.

    Raises:
        UsageError: A file cannot be read; the text names it.
    """
    parameters: dict[str, float] = {}
    for file in vehicle.firmware.parameters if vehicle.firmware else ():
        parameters |= read_parameter_file(file)
    return parameters | dict(vehicle.parameters)


def check_autopilot(vehicle: VehicleSpec) -> None:
    """Check that the autopilot of a vehicle is there, and so are the files of a program.

    Raises:
        UsageError: Something is not. The text does not name the vehicle.
    """
    family_of(vehicle, ProgramFolder(Path()))
    parameters_of(vehicle)


def check_programs(vehicles: Iterable[VehicleSpec]) -> None:
    """Check that all programs of real firmware, their files and FMUs are there, before any starts.

    Raises:
        UsageError: Some are not; the text names every vehicle, and what to do.
    """
    problems: dict[str, list[str]] = {}
    for vehicle in vehicles:
        try:
            if vehicle.firmware is not None:
                check_autopilot(vehicle)
            check_body(vehicle)
        except UsageError as error:
            problems.setdefault(str(error), []).append(vehicle.name)
    if problems:
        raise UsageError("\n".join(f"{', '.join(names)}: {what}" for what, names in problems.items()))


def remark_on(vehicle: str, project: str, autopilot: RealFirmware) -> str:
    """Return which program flew a vehicle, in what network, and which of its sensors were the world's."""
    process = autopilot.process
    version = f" {autopilot.version}" if autopilot.version else ""
    network = "a network of its own" if process.isolated else "the network of this computer"
    ours = PROGRAMS[project].sensors
    return (
        f"{vehicle}: flown by the program {process.program}{version} of {project}, in {network}; volery"
        f" gives it {ours}, all other sensors are its own"
    )
