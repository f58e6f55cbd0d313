"""MAVROS's names.

Differences from MAVROS: publishers are reliable, as in ROS 1; it speaks as a ground station's system id,
which is the only one from which ArduPilot takes sticks; it asks for the streams it publishes, as roscopter
does; topics that few need are published while somebody subscribes to them.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import Ns
from volery.bridge import diagnostics, inertial, missions, parameters, placing, status, targets, transforms
from volery.bridge.commands import Commands
from volery.bridge.offering import Names, Offering, Surroundings, together
from volery.bridge.setpoints import subscriptions
from volery.bridge.streams import EXTENDED_STATUS, EXTRA1, EXTRA2, POSITION, RAW_SENSORS, RC

STREAMS: Mapping[int, int] = {RAW_SENSORS: 1, EXTENDED_STATUS: 2, RC: 1, POSITION: 10, EXTRA1: 4, EXTRA2: 1}

TOPICS = (
    *status.TOPICS,
    *placing.TOPICS,
    *inertial.TOPICS,
    *targets.TOPICS,
    *missions.TOPICS,
    *parameters.TOPICS,
    *transforms.TOPICS,
    *diagnostics.TOPICS,
)


def offer(around: Surroundings) -> Offering:
    """All that is served."""
    said, asked = status.Status(around), Commands(around)
    stored, kept = missions.Missions(around), parameters.Parameters(around)
    placed, health = placing.Placing(around), diagnostics.Diagnostics(around)
    moving = (inertial.Inertial(around), targets.Targets(around), transforms.Transforms(around))

    def disconnected(stamp: Ns) -> None:
        said.disconnected(stamp)
        health.disconnected(stamp)

    return Offering(
        topics=TOPICS,
        translators=together(*(part.translators() for part in (said, placed, *moving, stored, kept, health))),
        subscriptions=subscriptions(around.geoid),
        services={**asked.services(), **stored.services(), **kept.services()},
        disconnected=disconnected,
    )


MAVROS = Names("mavros", offer, STREAMS, home=True)
