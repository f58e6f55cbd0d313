"""A simulated ArduPilot at the end of a link, and the facts that were recorded of the real one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.station import STATION, TARGET, Station, facts_of
from volery.base.frames import LocalFrame
from volery.base.time import from_seconds
from volery.simulation.autopilots.ardupilot import FIRMWARE


class Bench(Station):
    """One vehicle, one ground station on one link."""

    firmware = FIRMWARE.of_version("4.5")
    home = LocalFrame(-35.363261, 149.165230, 584.0)
    heading = 353.0

    def at(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(max(self.kernel.now(), from_seconds(seconds)), action)

    def mode(self, number: int) -> int | None:
        return self.command(176, 1, number)

    def sticks(self, *pulses: int, system: int = STATION) -> None:
        channels = {f"chan{number}_raw": pulse for number, pulse in enumerate(pulses, start=1)}
        self.send("RC_CHANNELS_OVERRIDE", system=system, **TARGET, **channels)

    def hold_sticks(self, seconds: float, *pulses: int) -> None:
        """Repeat them for that long, ten times a second."""
        for _ in range(round(seconds * 10)):
            self.sticks(*pulses)
            self.run(0.1)

    def stream(self, rate: int = 10, group: int = 0) -> None:
        self.send(
            "REQUEST_DATA_STREAM",
            **TARGET,
            req_stream_id=group,
            req_message_rate=rate,
            start_stop=1,
        )

    def names(self) -> list[str]:
        """The messages that came, each once, in order."""
        return list(dict.fromkeys(one.name for one in self.received))

    def airborne(self, height: float = 10.0) -> None:
        """In GUIDED at that height."""
        self.beat()
        assert self.mode(4) == 0
        assert self.command(400, 1) == 0
        assert self.command(22, 0, 0, 0, 0, 0, 0, height) == 0
        self.run_until(lambda: self.height > height - 0.3)
        self.run(6.0)


@pytest.fixture(scope="session")
def facts() -> dict[str, Any]:
    """What ``extract.py`` found in the recordings."""
    return facts_of("ardupilot")


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """Makes vehicles: ``bench()`` a warm copter, ``bench("rover", warm=False)`` a rover that boots."""
    return Bench
