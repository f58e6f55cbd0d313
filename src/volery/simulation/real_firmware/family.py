"""The family of autopilots that a program of real firmware makes; see ``AutopilotFamily``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import UsageError, choices
from volery.base.seeds import stream
from volery.kernel.api import Kernel
from volery.links.link import WireFormat
from volery.links.mavlink_codec import MAVLINK
from volery.simulation.autopilots.autopilot import GROUND_STATION
from volery.simulation.autopilots.fleet_autopilot import DefaultLink
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware import ardupilot, px4
from volery.simulation.real_firmware.firmware_instance import Assignment, FirmwareInstance
from volery.simulation.real_firmware.lock_step import RealFirmware

PROJECTS: Mapping[str, Callable[[Assignment], FirmwareInstance]] = {
    "ardupilot": ardupilot.start,
    "px4": px4.start,
}
"""How an instance of each project is started."""


@dataclass(frozen=True, kw_only=True)
class RealFirmwareFamily:
    """Autopilots of one program.

    Attributes:
        name: Name of the project, one of ``PROJECTS``.
        program: The firmware.
        folder: Folder in which each instance gets one, named after its vehicle.
        repeatable: Whether its answers are to be the same in each run; it keeps no log then.
        seed: Seed of the noise while an instance warms up.
    """

    name: str
    program: Path
    folder: Path
    repeatable: bool = False
    seed: int = 0
    codec: WireFormat | None = MAVLINK
    default_links: tuple[DefaultLink, ...] = (GROUND_STATION,)
    airframes: bool = True

    def of_version(self, version: str) -> RealFirmwareFamily:
        """Return itself. Raises ``UsageError`` for a version: the program has its own."""
        if version:
            raise UsageError(f"version {version!r}: {self.program} has a version of its own; leave it out")
        return self

    def with_features(self, names: str) -> RealFirmwareFamily:
        """Return itself. Raises ``UsageError`` for features: the program has its own."""
        if names:
            raise UsageError(f"features {names!r}: {self.program} has what it was built with; leave them out")
        return self

    def create(
        self,
        kernel: Kernel,
        flight: Flight,
        *,
        system: int = 1,
        parameters: Mapping[str, float] | None = None,
        warm: bool = False,
        name: str = "",
        logging: bool = False,
    ) -> RealFirmware:
        """Start the program for a body; see ``AutopilotFamily.create``.

        Raises:
            UsageError: There is no such project.
            FirmwareError: The program cannot be started, or, *warm*, does not get ready.
        """
        if self.name not in PROJECTS:
            raise UsageError(f"there is no link to a firmware of {self.name}; there is {choices(PROJECTS)}")
        name = name or f"{self.name}_{system}"
        assignment = Assignment(
            name=name,
            flight=flight,
            program=self.program,
            folder=self.folder / name,
            parameters=parameters or {},
            system=system,
            repeatable=self.repeatable,
        )
        instance = PROJECTS[self.name](assignment)
        random = stream(self.seed, f"firmware/{name}")
        autopilot = RealFirmware(kernel, flight, instance, name, self.name, random)
        try:
            if warm:
                autopilot.start(warm=True)
        except BaseException:
            autopilot.close()
            raise
        return autopilot
