"""What a dialect of PX4 says of every vehicle, whatever its kind."""

from __future__ import annotations

from functools import partial

from volery.simulation.autopilots.firmware import Firmware
from volery.simulation.autopilots.px4 import boot, missions
from volery.simulation.autopilots.px4.commander import READY_AFTER

STICKS_AT_REST = (1500,) * 4 + (0,) * 12

px4 = partial(
    Firmware,
    name="px4",
    memory=boot.memory,
    boot_events=boot.EVENTS,
    ready_after=boot.STREAMS,
    origin_after=boot.HOME,
    position_after=READY_AFTER,
    local_position_after=boot.STREAMS,
    on_warm=boot.stand,
    on_warm_position=boot.on_position,
    watch_every=1,
    each_second=boot.nothing,
    transmitter=STICKS_AT_REST,
    on_disarmed=boot.nothing,
    throttle_centred=True,
    first_item=0,
    actions_count=True,
    mission_item_done=missions.item_done,
    mission_item_begins=missions.item_begins,
    mission_ended=missions.ended,
    mission_action=missions.act,
    own_parameters=boot.own_parameters,
)
"""A ``Firmware`` but for what depends on the kind."""
