"""A simulated ArduPilot and a station at the other end of its link."""

from __future__ import annotations

from typing import Any

import pytest

from rigs.station import Station
from volery.base.frames import LocalFrame
from volery.simulation.autopilots.ardupilot import FIRMWARE


class ArduPilotStation(Station):
    """One vehicle, one ground station on one link."""

    firmware = FIRMWARE.of_version("4.5")
    home = LocalFrame(46.0, 7.0, 500.0)

    def listed(self, item: int, **fields: Any) -> None:
        """Fly a mission of that item alone, in AUTO."""
        blank = {f"param{place}": 0.0 for place in range(1, 5)} | {"x": 0, "y": 0, "z": 0.0, "frame": 3}
        target = {"target_system": 1, "target_component": 1}
        items = [{**blank, "command": 16}, {**blank, "command": item, **fields}]
        self.send("MISSION_COUNT", **target, count=len(items), mission_type=0)
        self.run(0.1)
        for number, one in enumerate(items):
            self.send(
                "MISSION_ITEM_INT", **target, seq=number, current=0, autocontinue=1, mission_type=0, **one
            )
            self.run(0.1)


class FullStation(ArduPilotStation):
    """One with all features on."""

    features = "all"


@pytest.fixture
def station(request: pytest.FixtureRequest) -> type[ArduPilotStation]:
    """Makes vehicles: ``station("rover", warm=False)`` a rover that boots."""
    return FullStation if request.node.get_closest_marker("optional") else ArduPilotStation
