"""The one stage of a real vehicle, in real time, for all checks."""

from __future__ import annotations

from typing import Any

from volery.base.errors import CapabilityError, UsageError
from volery.kernel.wall import WallKernel
from volery.run.assembly.ros_graphs import GRAPHS
from volery.run.assembly.vehicles import EMBEDDED
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.testing.checks import ImpossibleError
from volery.testing.stage import Commander, Stage
from volery.testing.tap import Tap
from volery.vehicles import Vehicle
from volery.vehicles.address import Address, open_link, parse
from volery.vehicles.driver import Driver, drivers


class RealStage(Stage):
    """See ``Stage``. *second* is the address of another link to the same vehicle, for other commanders."""

    def __init__(self, address: Address, kind: type[Vehicle], second: str) -> None:
        super().__init__()
        self.kernel: WallKernel = WallKernel()
        self._address, self._kind = address, kind
        self._second = parse(second) if second else None
        if self._second is not None and self._second.driver != address.driver:
            raise UsageError(f"{second} is not a second link to {address}: it names another driver")
        self._tap, self.driver = self._open(address)
        self.drone = kind(self.kernel, address.driver, self.driver)

    def _open(self, address: Address, **more: str) -> tuple[Tap, Driver]:
        if address.carrier in (EMBEDDED, *GRAPHS):
            raise CapabilityError(f"{address}: the checks reach real vehicles over bytes only")
        factory = drivers.load(address.driver)
        if factory.on_link is None:
            raise UsageError(f"{address}: {address.driver} is reached over a graph, not over bytes")
        tap = Tap(open_link(self.kernel, address, factory.codec))
        options = {name: value for name, value in address.options.items() if name != "baud"} | more
        return tap, factory.on_link(self.kernel, tap, address.driver, options)

    @property
    def tap(self) -> Tap:
        """The hand on our end of the link: the vehicle's end is as it is."""
        return self._tap

    def _at_second(self, **more: str) -> tuple[Tap, Driver]:
        if self._second is None:
            raise ImpossibleError("needs a second link to the vehicle: state one with --second URL")
        return self._open(self._second, **more)

    def _commander(self) -> Commander:
        tap, driver = self._at_second()
        return Commander(self.kernel, driver, tap, drivers.load(self._address.driver).codec.name)

    def another_program(self) -> Any:
        """On the second link."""
        return self._kind(self.kernel, self._address.driver, self._at_second()[1])

    def of_system(self, system: int) -> Any:
        """On the second link. Raises ``ImpossibleError`` for drivers that do not ask for a system id."""
        try:
            driver = self._at_second(system=str(system))[1]
        except UsageError as error:
            raise ImpossibleError(f"the driver takes no system id: {error}") from None
        return self._kind(self.kernel, self._address.driver, driver)

    @property
    def flight(self) -> Flight:
        """Nobody can break a real one from here."""
        raise ImpossibleError("only a simulated vehicle can be broken from here")

    @property
    def neighbour(self) -> Any:
        """Nobody knows of one."""
        raise ImpossibleError("needs a second vehicle on the same link")

    def rest(self) -> None:
        """The wire is mended and the vehicle brought down, unless somebody else has it."""
        self._tap.mend()
        super().rest()
        self.drone.come_to_rest()

    def close(self) -> None:
        """Hang up."""
        self.drone.close()
        self.kernel.close()
