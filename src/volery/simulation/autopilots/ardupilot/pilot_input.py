"""Input of a pilot to ArduPilot: manual control by link, and the switches of the transmitter.

By link only the station that SYSID_MYGCS names counts. Thresholds and times of the switches are those of
ArduPilot: six positions of the mode switch, 0.2 s until a new one counts, two seconds of full rudder to arm,
three for a rover.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians
from typing import Any

from volery.base.elementary import cos, sin
from volery.base.time import MS, Ns, S, from_seconds
from volery.simulation.autopilots.ardupilot.failsafes import radio_lost
from volery.simulation.autopilots.ardupilot.feature import Kept
from volery.simulation.autopilots.ardupilot.modes import arm, change_mode, disarm, received_of
from volery.simulation.autopilots.manual_control import ChannelRange
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import WARNING

IGNORE, RELEASE = 65_535, 65_534
LAST_PLAIN_CHANNEL = 8
INVALID_AXIS = 32_767


@dataclass
class TransmitterSwitches:
    """Switches of the transmitter, as the firmware has read them. Times in ns."""

    mode: int = 0
    """Position of the mode switch, from 1; 0: not read yet."""
    read: int = 0
    """Position that it may have moved to."""
    read_since: Ns = NEVER
    rudder_since: Ns = NEVER
    """Since when the yaw stick has been at the same end with the throttle closed."""
    rudder: int = 0
    """That end: 1 right, -1 left."""
    options: dict[int, int] = field(default_factory=dict)
    """Position of the switch by channel: 1 up, 0 in the middle, -1 down."""
    emergency_stop: bool = False
    interlock_closed: bool = False
    overrides_denied: bool = False
    """Whether a switch denies the sticks of a ground station."""
    mixed_steering: tuple[float, float] = (0.0, 0.0)
    """Steering that the pilot adds to that of the controls, and the share that these lose, as last given."""
    read_from: tuple[list[int], int] | None = None
    """Pulse widths of all channels, and changes of parameters, that all of them were last read from."""


switches_of = Kept(TransmitterSwitches)


@dataclass
class SimulatedFaults:
    """Faults that parameters inject."""

    values: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0, 180.0, 12.6, 0.0, 0.0)
    """Values of the parameters as they were last applied."""
    compared_at: int = -1
    """Changes of parameters when these were last compared."""
    no_receiver_since: Ns = NEVER
    """Since when the parameters have left the autopilot without a receiver of satellites."""
    pushed: bool = False
    """Whether a simulated force from outside acts."""


faults_of = Kept(SimulatedFaults)


def _is_my_station(vehicle: AutopilotVehicle, sender: int) -> bool:
    return sender == round(vehicle.parameters["SYSID_MYGCS"])


def on_heartbeat(vehicle: AutopilotVehicle, _fields: dict[str, Any], sender: int) -> None:
    """Handle HEARTBEAT."""
    if _is_my_station(vehicle, sender):
        received_of(vehicle).station_at = vehicle.kernel.now()


def on_override(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle RC_CHANNELS_OVERRIDE.

    Channels 1 to 8: 0 releases, 65535 is ignored. From channel 9: 0 and 65535 are ignored, 65534 releases.
    """
    if not _is_my_station(vehicle, sender):
        return
    now = vehicle.kernel.now()
    received_of(vehicle).station_at = now
    if switches_of(vehicle).overrides_denied:
        return
    for channel in range(1, len(vehicle.rc.transmitter) + 1):
        pulse = fields[f"chan{channel}_raw"]
        if channel <= LAST_PLAIN_CHANNEL:
            if pulse != IGNORE:
                vehicle.rc.override(channel, pulse, now)
        elif pulse not in (0, IGNORE):
            vehicle.rc.override(channel, 0 if pulse == RELEASE else pulse, now)
    sticks_moved(vehicle)


def on_manual_control(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle MANUAL_CONTROL: axes -1000..1000 over the whole range of their channels, throttle 0..1000."""
    if not _is_my_station(vehicle, sender) or fields["target"] != vehicle.system:
        return
    now = vehicle.kernel.now()
    received_of(vehicle).station_at = now
    if switches_of(vehicle).overrides_denied:
        return
    sticks = vehicle.tuning.sticks
    roll, pitch, throttle, yaw = sticks.travels
    middle = vehicle.rules.rc.throttle_centred
    _give(vehicle, sticks.roll, roll, _share(fields["y"]))
    if vehicle.flies:
        _give(
            vehicle,
            sticks.pitch,
            pitch,
            _share(-fields["x"] if fields["x"] != INVALID_AXIS else INVALID_AXIS),
        )
        _give(vehicle, sticks.yaw, yaw, _share(fields["r"]))
    _give(
        vehicle, sticks.throttle, throttle, _share(fields["z"]) if middle else _share(2 * fields["z"] - 1000)
    )
    sticks_moved(vehicle)


def _share(axis: int) -> float | None:
    """Return an axis -1000..1000 as 0..1, or None if the axis is not given."""
    if axis == INVALID_AXIS:
        return None
    return min(1.0, max(0.0, (axis + 1000) / 2000.0))


def _give(vehicle: AutopilotVehicle, channel: int, travel: ChannelRange, share: float | None) -> None:
    pulse = 0 if share is None else max(0, travel.pulse(share))
    vehicle.rc.override(channel, pulse, vehicle.kernel.now())


def sticks_moved(vehicle: AutopilotVehicle) -> None:
    """Let a mode that the pilot flies act at once; other modes act at the next tick."""
    if vehicle.armed and vehicle.mode.pilot:
        vehicle.run_manoeuvre()


def on_step(vehicle: AutopilotVehicle) -> None:
    """Simulate a failing transmitter and expire overrides, at each tick."""
    simulate_rc_failure(vehicle)
    received, faults = received_of(vehicle), faults_of(vehicle)
    if not received.transmitter:
        pulses = not _no_pulses(vehicle)
        received.transmitter = pulses or bool(vehicle.rc.overridden)
    if vehicle.parameters.changes != faults.compared_at:
        faults.compared_at = vehicle.parameters.changes
        simulate_push(vehicle)
        simulate_faults(vehicle)
    expire_overrides(vehicle)


OWN_VOLTAGE = 12.6
"""SIM_BATT_VOLTAGE that leaves the battery as it is."""


def simulate_faults(vehicle: AutopilotVehicle) -> None:
    """Inject the faults and the wind that SIM_ parameters name, once after each change; GPS_TYPE 0, too."""
    parameters = vehicle.parameters
    motor_and_share = parameters["SIM_ENGINE_FAIL"], parameters["SIM_ENGINE_MUL"]
    wind = parameters["SIM_WIND_SPD"], parameters["SIM_WIND_DIR"]
    no_receiver = parameters["GPS_TYPE"] == 0.0 or parameters["SIM_GPS_TYPE"] == 0.0
    blocked = no_receiver or parameters["SIM_GPS_DISABLE"] != 0.0
    volts = round(parameters["SIM_BATT_VOLTAGE"], 3)
    glitch = parameters["SIM_GPS_GLITCH_X"], parameters["SIM_GPS_GLITCH_Y"]
    faults = faults_of(vehicle)
    if not no_receiver:
        faults.no_receiver_since = NEVER
    elif faults.no_receiver_since == NEVER:
        faults.no_receiver_since = vehicle.kernel.now()
    wanted = (float(blocked), *motor_and_share, *wind, volts, *glitch)
    before = faults.values
    if wanted == before:
        return
    faults.values = wanted
    if volts != before[5]:
        vehicle.flight.set_voltage(None if volts == OWN_VOLTAGE else volts)
    if wind != before[3:5]:
        speed, towards = wind[0], radians(wind[1] + 180.0)
        vehicle.flight.set_wind(north=speed * cos(towards), east=speed * sin(towards))
    if glitch != before[6:]:
        latitude, longitude, amsl = vehicle.estimate.origin
        there = vehicle.flight.to_ned(latitude + glitch[0], longitude + glitch[1], amsl)
        vehicle.flight.offset_gps(there[0], there[1])
    vehicle.flight.block_gps(bool(wanted[0]))
    if vehicle.flies:
        for motor in range(vehicle.flight.rotors):
            weak = motor == round(wanted[1])
            vehicle.flight.weaken_motor(motor, min(1.0, max(0.0, wanted[2])) if weak else 1.0)


def simulate_push(vehicle: AutopilotVehicle) -> None:
    """Push a copter by SIM_SHOVE_X, _Y and _Z, forward, right, down, for SIM_SHOVE_TIME, then 0."""
    parameters, faults = vehicle.parameters, faults_of(vehicle)
    lasts = round(parameters["SIM_SHOVE_TIME"]) * MS
    if lasts <= 0 or not vehicle.flies:
        return
    vehicle.flight.push(parameters["SIM_SHOVE_X"], -parameters["SIM_SHOVE_Y"], -parameters["SIM_SHOVE_Z"])
    if faults.pushed:
        return
    faults.pushed = True

    def end() -> None:
        faults.pushed = False
        vehicle.flight.push(0.0, 0.0, 0.0)
        parameters.set("SIM_SHOVE_TIME", 0.0)

    vehicle.kernel.call_at(vehicle.kernel.now() + lasts, end)


def expire_overrides(vehicle: AutopilotVehicle) -> None:
    """Release overrides that are older than RC_OVERRIDE_TIME; 0 ignores them, a negative time keeps them."""
    seconds = vehicle.parameters["RC_OVERRIDE_TIME"]
    changed = vehicle.rc.admit(overrides=seconds != 0.0)
    if seconds > 0.0 and vehicle.rc.expire(vehicle.kernel.now(), from_seconds(seconds)):
        changed = True
    if changed:
        sticks_moved(vehicle)


def simulate_rc_failure(vehicle: AutopilotVehicle) -> None:
    """Simulate the loss of the transmitter, which reads as a throttle of 950 us, and its end.

    It is lost by a fault of the world, or by the values 1 and 2 of SIM_RC_FAIL.
    """
    throttle = vehicle.tuning.sticks.throttle
    if vehicle.parameters["SIM_RC_FAIL"] or vehicle.flight.transmitter_blocked:
        vehicle.rc.transmitter[throttle - 1] = FAILED_THROTTLE
    elif vehicle.rc.transmitter[throttle - 1] == FAILED_THROTTLE:
        vehicle.rc.transmitter[throttle - 1] = vehicle.rules.rc.transmitter[throttle - 1]


def _no_pulses(vehicle: AutopilotVehicle) -> bool:
    return vehicle.parameters["SIM_RC_FAIL"] == NO_PULSES or vehicle.flight.transmitter_blocked


LACKING = 0.3
"""Share of a motor's thrust up to which the copter cannot be held."""


def lacks_motor(vehicle: AutopilotVehicle) -> bool:
    """Return whether SIM_ENGINE_MUL has taken a motor from a copter.

    The original's simulator sets a falling copter level at its first contact, and its landed detector waits
    for the lower limit of the motors: such a copter is neither crashed nor landed, and stays armed.
    """
    return vehicle.parameters["SIM_ENGINE_MUL"] <= LACKING


FULL_STICK_US = 400.0
"""Deflection of the stick from its trim at which the pilot alone steers [us]."""


def mix_steering(vehicle: AutopilotVehicle) -> None:
    """Add the pilot's steering to a rover's own in the modes that the autopilot drives, by STICK_MIXING."""
    mixed = 0.0, 0.0
    drives = not vehicle.mode.pilot and vehicle.mode.needs_position
    if drives and vehicle.parameters["STICK_MIXING"] and not radio_lost(vehicle):
        sticks = vehicle.tuning.sticks
        travel, pulse = sticks.travels[0], vehicle.rc[sticks.roll]
        steering = travel.deflection(pulse)
        if steering:
            mixed = steering, min(1.0, abs(pulse - travel.trim) / FULL_STICK_US)
    if mixed != switches_of(vehicle).mixed_steering:
        switches_of(vehicle).mixed_steering = mixed
        vehicle.flight.mix_steering(*mixed)


NO_PULSES = 1.0
"""SIM_RC_FAIL: nothing is received."""
FAILED_THROTTLE = 950
POSITIONS = (1230, 1360, 1490, 1620, 1749)
"""Upper ends of the first five positions of the mode switch [us]."""
LOWEST, HIGHEST = 900, 2200
"""Pulse widths outside are no position."""
SETTLED: Ns = 200 * MS
FULL_RUDDER = 0.89
TRACK_SPACING, TRACK_POINTS = 2.0, 300
"""SRTL_ACCURACY [m] and SRTL_POINTS."""
TRACK_LOST: Ns = 15 * S
"""Time without a position after which the track ends."""

NEVER_AGAIN: Ns = 1 << 62


def position_of(pulse: int) -> int:
    """Return the position of the mode switch, from 1; 0 for a pulse width that is none."""
    if not LOWEST < pulse < HIGHEST:
        return 0
    return 1 + sum(pulse > end for end in POSITIONS)


def sticks_rest(vehicle: AutopilotVehicle) -> bool:
    """Return whether switches and rudder, read again, would have no effect.

    So it is while no channel and no parameter has changed, and neither mode switch nor rudder is timed.
    """
    switches = switches_of(vehicle)
    read_from = vehicle.rc.pulses(), vehicle.parameters.changes
    rest = read_from == switches.read_from and not switches.rudder and switches.read in (0, switches.mode)
    switches.read_from = read_from
    return rest


def _mode_position(vehicle: AutopilotVehicle, channel: str) -> int | None:
    """Return the position of the mode switch, or ``None`` if the parameter *channel* names no channel."""
    number = round(vehicle.parameters[channel])
    return position_of(vehicle.rc[number]) if 1 <= number <= len(vehicle.rc.transmitter) else None


def keep_mode(vehicle: AutopilotVehicle, channel: str) -> None:
    """Count the mode switch as read: a warm vehicle has taken its mode from it before the run."""
    switches_of(vehicle).mode = switches_of(vehicle).read = _mode_position(vehicle, channel) or 0


def read_mode_switch(vehicle: AutopilotVehicle, channel: str, modes: str) -> None:
    """Enter the mode of the switch, after a boot as soon as there is a transmitter, then once it has moved.

    Args:
        vehicle: The vehicle.
        channel: Parameter with the number of the channel.
        modes: Parameter with the number of a mode, without the position.
    """
    position = _mode_position(vehicle, channel)
    booting = vehicle.uptime() < vehicle.rules.startup.ready_after
    if position is None or booting or _no_pulses(vehicle) or radio_lost(vehicle):
        return
    now, switches = vehicle.kernel.now(), switches_of(vehicle)
    if position != switches.read:
        switches.read, switches.read_since = position, now
    if not position or now - switches.read_since < SETTLED or position == switches.mode:
        return
    switches.mode = position
    change_mode(vehicle, round(vehicle.parameters[f"{modes}{position}"]))


def read_rudder(vehicle: AutopilotVehicle, hold: Ns) -> None:
    """Arm with the yaw stick right and disarm with it left, the throttle closed.

    Args:
        vehicle: The vehicle.
        hold: Time for which the stick must be held [ns].
    """
    permitted = round(vehicle.parameters["ARMING_RUDDER"])
    sticks, switches, now = vehicle.tuning.sticks, switches_of(vehicle), vehicle.kernel.now()
    stick = 3 if vehicle.flies else 0
    yaw = sticks.travels[stick].deflection(vehicle.rc[sticks.yaw if vehicle.flies else sticks.roll])
    if vehicle.flies:
        closed = sticks.read(vehicle.rc).throttle <= 0.0
    else:
        closed = sticks.travels[2].deflection(vehicle.rc[sticks.throttle]) == 0.0
    side = (yaw > FULL_RUDDER) - (yaw < -FULL_RUDDER) if closed and permitted else 0
    if side != switches.rudder:
        switches.rudder, switches.rudder_since = side, now
    if not side or now - switches.rudder_since < hold:
        return
    switches.rudder_since = NEVER_AGAIN
    if side > 0 and not vehicle.armed:
        arm(vehicle, by_rudder=True)
    elif side < 0 and permitted == 2 and vehicle.armed and (vehicle.landed or not vehicle.flies):
        disarm(vehicle, force=False)


def keep_track(vehicle: AutopilotVehicle) -> None:
    """Add the position of an armed vehicle to its track; a point near an earlier one cuts the loop.

    Without a position for 15 s the track ends, and SMART_RTL is refused until the next arming.
    """
    ground, now = vehicle.ground, vehicle.kernel.now()
    if not vehicle.armed or ground.track_ended:
        return
    if not vehicle.has_position:
        if ground.track_lost_since == NEVER:
            ground.track_lost_since = now
        elif now - ground.track_lost_since > TRACK_LOST:
            ground.track.clear()
            ground.track_ended = True
            vehicle.send_text(WARNING, "SmartRTL deactivated: bad position")
        return
    ground.track_lost_since = NEVER
    if vehicle.mode.name == "SMART_RTL":
        return
    (x, y, z), track = vehicle.estimate.position, ground.track
    near = TRACK_SPACING * TRACK_SPACING
    for place in range(-1, len(track) - 1):  # the last point first
        north, east, down = track[place]
        if (x - north) * (x - north) + (y - east) * (y - east) + (z - down) * (z - down) < near:
            del track[place % len(track) + 1 :]
            return
    if len(track) < TRACK_POINTS:
        track.append((x, y, z))
