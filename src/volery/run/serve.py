"""``serve``: a simulated vehicle for ground stations, MAVSDK, MAVProxy or a script of your own."""

from __future__ import annotations

from collections.abc import Callable

from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.links.coded import CodedLink
from volery.run.airfield import Airfield
from volery.run.simulated import Simulated, airfield_of
from volery.vehicles.address import Address
from volery.vehicles.carriers import listen

GROUND_STATION = "udp://127.0.0.1:14550"
"""Where ground stations listen."""


class Server:
    """One simulated vehicle, reachable at *address* in virtual time that passes *speed* times as fast as real
    time.

    TCP serves any number of clients; UDP sends to a host, or answers the first who speaks. Raises
    ``UsageError`` for an address that cannot be opened.
    """

    def __init__(self, wanted: Simulated, address: Address, *, speed: float = 1.0, seed: int = 1) -> None:
        self.kernel = VirtualKernel(pace=speed)
        self.airfield: Airfield = airfield_of(self.kernel, [wanted], seed)
        self._autopilot = self.airfield.autopilots[wanted.vehicle.name]
        codec = self.airfield.codec(wanted.vehicle.name)
        self.link: CodedLink = listen(self.kernel, address, joined=self._greet, codec=codec)
        self._autopilot.connect(self.link)

    def _greet(self) -> None:
        self.link.send_bytes(self._autopilot.banner)

    def run(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serve until the process is told to stop (``KeyboardInterrupt``). *ready* is called once it can be
        reached.
        """
        ready()
        try:
            self.kernel.run(FOREVER)
        finally:
            self.link.close()
            self.kernel.close("the server was stopped")
