"""Messages that an autopilot forwards from one link to another."""

from __future__ import annotations

from typing import Any

import pytest

from rigs.station import Station
from volery.base.frames import LocalFrame
from volery.links.frame import Frame
from volery.simulation.autopilots.ardupilot import FIRMWARE

COMPANION, COMPONENT, STATION = 7, 9, 255


class ArduPilotStation(Station):
    """One vehicle, whose first link is a ground station's."""

    firmware = FIRMWARE
    home = LocalFrame(46.0, 7.0, 500.0)


class Ends:
    """A ground station and a companion computer on two links, and a third link that nothing has used."""

    def __init__(self, **parameters: float) -> None:
        self.rig = ArduPilotStation(parameters=parameters)
        self.companion, self.third = self.rig.another_link(), self.rig.another_link()
        self.came: dict[str, list[Frame]] = {"station": [], "companion": [], "third": []}
        for name, link in (
            ("station", self.rig.link),
            ("companion", self.companion),
            ("third", self.third),
        ):
            link.receive(self.came[name].append)
        self.rig.run(0.5)
        self.rig.send("HEARTBEAT", type=6, autopilot=8)
        self.from_companion("HEARTBEAT", type=18, autopilot=8)
        self.rig.run(0.1)

    def from_companion(self, name: str, **fields: Any) -> None:
        self.companion.send(Frame(name, fields, COMPANION, COMPONENT))

    def foreign(self, name: str, at: str) -> int:
        """How many messages of that name, that are not the autopilot's own, came there."""
        return sum(frame.name == name and frame.system != 1 for frame in self.came[at])


@pytest.fixture
def ends() -> type[Ends]:
    return Ends


def test_heartbeats_go_to_the_other_links_in_use(ends: Any) -> None:
    both = ends()
    both.rig.send("HEARTBEAT", type=6, autopilot=8)
    both.rig.run(0.1)
    assert both.foreign("HEARTBEAT", "station") == 1
    assert both.foreign("HEARTBEAT", "companion") == 1
    assert both.foreign("HEARTBEAT", "third") == 0
    assert both.came["station"][-1].component in (1, COMPONENT)


def test_a_message_with_a_target_goes_to_the_links_of_its_target(ends: Any) -> None:
    both = ends()
    both.rig.send("COMMAND_LONG", target_system=COMPANION, target_component=COMPONENT, command=512)
    both.rig.send("COMMAND_LONG", target_system=1, target_component=1, command=512, param1=148.0)
    both.from_companion("COMMAND_ACK", target_system=STATION, target_component=190, command=512, result=0)
    both.rig.run(0.1)
    assert both.foreign("COMMAND_LONG", "companion") == 1
    assert both.foreign("COMMAND_LONG", "third") == 0
    assert both.foreign("COMMAND_ACK", "station") == 1


def test_a_message_without_a_target_goes_to_all_links_in_use(ends: Any) -> None:
    both = ends()
    both.from_companion("STATUSTEXT", severity=6, text="tired")
    both.from_companion("RADIO_STATUS", rssi=9)
    both.rig.run(0.1)
    assert both.foreign("STATUSTEXT", "station") == 1
    assert both.foreign("STATUSTEXT", "companion") == 0
    assert both.foreign("RADIO_STATUS", "station") == 0


def test_a_private_link_neither_gives_nor_gets(ends: Any) -> None:
    both = ends(SERIAL1_OPTIONS=1024)
    both.rig.send("HEARTBEAT", type=6, autopilot=8)
    both.rig.send("STATUSTEXT", severity=6, text="hello")
    both.from_companion("STATUSTEXT", severity=6, text="tired")
    both.rig.run(0.1)
    assert both.foreign("HEARTBEAT", "station") == both.foreign("HEARTBEAT", "companion") == 0
    assert both.foreign("STATUSTEXT", "station") == both.foreign("STATUSTEXT", "companion") == 0
    both.rig.send("COMMAND_LONG", target_system=COMPANION, target_component=COMPONENT, command=512)
    both.rig.run(0.1)
    assert both.foreign("COMMAND_LONG", "companion") == 1
