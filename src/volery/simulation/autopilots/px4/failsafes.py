"""Automatic actions of PX4's commander at each tick: ground detection, geofence, other failsafes, disarming.

A failsafe replaces only one of lower rank. Most actions are preceded by a hold of COM_FAIL_ACT_T, in which
the pilot may react.

Observed with GF_MAX_HOR_DIST and GF_ACTION 3: a DO_REPOSITION beyond the limit is acknowledged as accepted,
AUTO.LOITER is entered, and the vehicle stays where it is; two texts and two events say why. What a breach in
flight does follows the firmware's documentation.
"""

from __future__ import annotations

import struct

from volery.base.frames import Vector
from volery.base.time import MS, Ns, S, from_seconds, to_seconds
from volery.simulation.autopilots.px4 import event_interface, modes
from volery.simulation.autopilots.px4.geofence import TOO_FAR, TOO_HIGH, fence_breach
from volery.simulation.autopilots.px4.modes import (
    BATTERY_CRITICAL,
    BATTERY_EMERGENCY,
    LINK_LOST,
    OFFBOARD_LOST,
    OUTSIDE_FENCE,
    POSITION_LOST,
    STICKS_LOST,
    CommanderState,
    commander_of,
)
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL, INFO

OUTSIDE = "Reposition is outside geofence\t"


def fence_admits(vehicle: AutopilotVehicle, point: Vector) -> bool:
    """Return whether a reposition may go to that point, and report where it may not.

    A geofence that does not act (GF_ACTION 0), or only warns (1), admits every point.
    """
    acts = round(vehicle.parameters["GF_ACTION"]) not in (0, WARN)
    beyond = fence_breach(vehicle, point) if acts else ""
    if not beyond:
        return True
    if commander_of(vehicle).version.warns_of_destinations:
        _report_breach(vehicle, beyond)
    vehicle.send_text(CRITICAL, OUTSIDE)
    commander_of(vehicle).log.send(event_interface.REPOSITION_OUTSIDE)
    return False


def _report_breach(vehicle: AutopilotVehicle, beyond: str) -> None:
    """Say which limit of the geofence was reached."""
    farthest, highest, fence = commander_of(vehicle).version.fence_texts
    log = commander_of(vehicle).log
    if beyond == TOO_FAR:
        limit = vehicle.parameters["GF_MAX_HOR_DIST"]
        vehicle.send_text(CRITICAL, farthest.format(limit))
        log.send(event_interface.FENCE_DISTANCE, event_interface.float_argument(limit))
    elif beyond == TOO_HIGH:
        limit = vehicle.parameters["GF_MAX_VER_DIST"]
        vehicle.send_text(CRITICAL, highest.format(limit))
        log.send(event_interface.FENCE_HEIGHT, event_interface.float_argument(limit))
    elif fence:
        vehicle.send_text(CRITICAL, fence)


WARN = 1
"""GF_ACTION that only warns."""

HOLD, RETURN, LAND, TERMINATE, DISARM = 1, 2, 3, 5, 6
"""Values of NAV_RCL_ACT and NAV_DLL_ACT."""

FENCE_ACTIONS, FENCE_TERMINATE = {2: HOLD, 3: RETURN, 5: LAND}, 4
"""GF_ACTION to the action; 1 only warns."""

ACTIONS = {HOLD: modes.LOITER, RETURN: modes.RTL, LAND: modes.LAND}
OFFBOARD_ACTIONS = {
    0: (modes.POSCTL, 2),
    1: (modes.ALTCTL, 2),
    2: (modes.MANUAL, 2),
    3: (modes.RTL, 6),
    4: (modes.LAND, 7),
    5: (modes.LOITER, 5),
}
"""COM_OBL_RC_ACT to the mode and to the number of the action in events."""

OUTRANKS = {
    "": 0,
    LINK_LOST: 1,
    OFFBOARD_LOST: 2,
    STICKS_LOST: 3,
    OUTSIDE_FENCE: 4,
    BATTERY_CRITICAL: 5,
    BATTERY_EMERGENCY: 6,
    POSITION_LOST: 7,
}
"""Rank of each failsafe."""

LOSS_DETECTION_DELAY = 145 * MS
"""Recorded: with COM_RC_LOSS_T = 0.5 s the loss was detected 0.63 to 0.65 s after the last sample."""

GROUND_CONTACT = S
"""Time for which PX4's landed detector waits for the ground contact; LANDED_AFTER is that of its other two
states."""

ON_GROUND_AFTER: Ns = 300 * MS
"""Without motors the vehicle counts as on the ground, in the air too: reported 0.42 s after a kill."""

RECOVERY = 0.25
"""Hold time [s] that is regained for each second without a failsafe, as recorded."""


def on_step(vehicle: AutopilotVehicle) -> None:
    """Run the commander for one tick."""
    commander = commander_of(vehicle)
    now = vehicle.kernel.now()
    passed = 0.0 if commander.last_step == NEVER else to_seconds(now - commander.last_step)
    commander.last_step = now
    commander.check_return()
    _detect_stick_loss(commander, now)
    _detect_ground(commander, now)
    _forget_ended_cause(commander)
    commander.faults.step()
    commander.vision.step()
    commander.examine_mission()
    if commander.home_correction is not None and vehicle.flies:
        commander.home_correction.step(commander.lifted_at if vehicle.armed else NEVER)
    if vehicle.armed and not commander.terminated:
        _check_failsafes(commander, passed)
    if vehicle.armed and not commander.terminated:
        _disarm_automatically(commander, now)
    commander.report()


# -- manual control


def _detect_stick_loss(commander: CommanderState, now: Ns) -> None:
    vehicle, sticks = commander.vehicle, commander.joystick
    patience = vehicle.seconds_parameter("COM_RC_LOSS_T") + LOSS_DETECTION_DELAY
    if sticks.valid and now - sticks.last_received_ns > patience:
        sticks.valid = False
        vehicle.rc.release()
        commander.log.send(event_interface.STICKS_LOST)


# -- ground


def _detect_ground(commander: CommanderState, now: Ns) -> None:
    vehicle = commander.vehicle
    if not vehicle.flies or (vehicle.armed and commander.terminated):
        return  # a terminated vehicle keeps its landed state
    if commander.control.seems_to_move:
        vehicle.ground.touched_at = now + GROUND_CONTACT
    flying = (not vehicle.estimate.landed or commander.control.lifts_off) and not vehicle.landed
    if flying and not commander.flying:
        commander.took_off, commander.lifted_at = True, now
        vehicle.send_text(INFO, "Takeoff detected\t")
        commander.log.send(event_interface.TAKEOFF_DETECTED)
    elif commander.flying and not vehicle.armed:
        flying = now - vehicle.arming.disarmed_at < ON_GROUND_AFTER  # a fall is not reported
        vehicle.ground.landed = not flying
    elif commander.flying and vehicle.landed:
        flying = False
        commander.landed_at = now
        vehicle.send_text(INFO, "Landing detected\t")
        commander.log.send(event_interface.LANDING_DETECTED)
    else:
        flying = commander.flying
    commander.flying = flying


def _disarm_automatically(commander: CommanderState, now: Ns) -> None:
    vehicle = commander.vehicle
    if not vehicle.flies or not vehicle.landed:
        return
    after_landing = vehicle.parameters["COM_DISARM_LAND"]
    waiting = vehicle.parameters["COM_DISARM_PRFLT"]
    if commander.took_off:
        if after_landing > 0.0 and now - commander.landed_at >= from_seconds(after_landing):
            commander.finish_disarming("landing", event_interface.BY_LANDING)
    elif waiting > 0.0 and now - vehicle.arming.armed_at >= from_seconds(waiting):
        commander.finish_disarming("auto preflight disarming", event_interface.BY_WAITING)


# -- failsafes


def _check_failsafes(commander: CommanderState, passed: float) -> None:
    vehicle = commander.vehicle
    _update_hold_delay(commander, passed)
    if vehicle.flies and vehicle.landed:
        _end_of_offboard_on_ground(commander)
        return
    _end_hold(commander)
    _check_position(commander)
    _check_battery(commander)
    _check_geofence(commander)
    _check_sticks(commander)
    _check_offboard(commander)
    _check_link(commander)


def _update_hold_delay(commander: CommanderState, passed: float) -> None:
    full = commander.vehicle.parameters["COM_FAIL_ACT_T"]
    if commander.hold_delay_left < 0.0 or commander.hold_delay_left > full:
        commander.hold_delay_left = full
    if not commander.failsafe:
        commander.hold_delay_left = min(full, commander.hold_delay_left + RECOVERY * passed)
    elif commander.hold_until != NEVER:
        commander.hold_delay_left = max(0.0, commander.hold_delay_left - passed)


def _end_of_offboard_on_ground(commander: CommanderState) -> None:
    if commander.failsafe == OFFBOARD_LOST and commander.stream_alive():
        commander.resume_requested()


def _forget_ended_cause(commander: CommanderState) -> None:
    """Let a failsafe that the user has ended act again once its cause has ended in between."""
    if not commander.taken_over:
        return
    causes = {
        STICKS_LOST: lambda: not commander.joystick.valid,
        LINK_LOST: lambda: _link_lost(commander),
        OUTSIDE_FENCE: lambda: bool(fence_breach(commander.vehicle, commander.vehicle.estimate.position)),
        BATTERY_CRITICAL: lambda: _battery_below(commander, CRITICALLY_LOW),
        BATTERY_EMERGENCY: lambda: _battery_below(commander, EMERGENCY),
    }
    cause = causes.get(commander.taken_over)
    if cause is None or not cause():
        commander.taken_over = ""


def _outranked(commander: CommanderState, name: str) -> bool:
    """Return whether a failsafe does not act: a higher one does, or the user has ended it."""
    if name == commander.taken_over:
        return True
    return OUTRANKS[commander.failsafe] >= OUTRANKS[name]


def _end_hold(commander: CommanderState) -> None:
    """Execute the action of a failsafe after its hold."""
    if commander.hold_until == NEVER or commander.vehicle.kernel.now() < commander.hold_until:
        return
    commander.hold_until, commander.hold_delay_left = NEVER, 0.0
    commander.vehicle.send_text(CRITICAL, "Failsafe activated\t")
    commander.log.send(event_interface.FAILSAFE_AFTER_HOLD, struct.pack("<HHBB", 0, 3, 6, 1))
    commander.begin_failsafe(commander.failsafe, commander.after_hold)


def _hold_first(commander: CommanderState, name: str, number: int) -> None:
    """Hold for the rest of COM_FAIL_ACT_T, then enter mode ``number``."""
    vehicle, left = commander.vehicle, commander.hold_delay_left
    if commander.hold_until != NEVER:
        commander.failsafe, commander.after_hold = name, number
        return
    if left <= 0.0:
        vehicle.send_text(CRITICAL, "Failsafe activated\t")
        commander.begin_failsafe(name, number)
        return
    seconds = max(1, round(left))
    vehicle.send_text(CRITICAL, commander.version.hold_words.format(seconds))
    commander.log.send(event_interface.FAILSAFE_HOLD, struct.pack("<HHBBBB", 0, 3, 6, seconds, 0, 1))
    commander.begin_failsafe(name, modes.LOITER)
    commander.hold_until = vehicle.kernel.now() + from_seconds(left)
    commander.after_hold = number


def _check_offboard(commander: CommanderState) -> None:
    vehicle = commander.vehicle
    if commander.requested != modes.OFFBOARD:
        return
    alive = commander.stream_alive()
    if commander.failsafe == OFFBOARD_LOST and alive:
        commander.resume_requested()
    elif not alive and not _outranked(commander, OFFBOARD_LOST):
        number, action = OFFBOARD_ACTIONS.get(
            round(vehicle.parameters["COM_OBL_RC_ACT"]), OFFBOARD_ACTIONS[0]
        )
        if number == modes.RTL and not commander.can_fly(modes.RTL):
            number = modes.LAND
        vehicle.send_text(CRITICAL, "Failsafe activated\t")
        commander.log.send(event_interface.FAILSAFE, bytes((0, 0, 6, 0, action)))
        commander.begin_failsafe(OFFBOARD_LOST, number)


STICK_EXCEPTIONS = {modes.MISSION: 1, modes.LOITER: 2, modes.OFFBOARD: 4}
"""Bits of COM_RCL_EXCEPT."""


def _check_sticks(commander: CommanderState) -> None:
    vehicle, sticks = commander.vehicle, commander.joystick
    action = round(vehicle.parameters["NAV_RCL_ACT"])
    if (
        sticks.valid
        or not sticks.ever_received
        or sticks.lost_when_armed
        or _outranked(commander, STICKS_LOST)
    ):
        return
    excepted = round(vehicle.parameters["COM_RCL_EXCEPT"]) & STICK_EXCEPTIONS.get(commander.requested, 0)
    if not action or excepted or commander.requested in (modes.RTL, modes.LAND):
        return
    _act(commander, STICKS_LOST, action)


def _check_link(commander: CommanderState) -> None:
    vehicle = commander.vehicle
    action = round(vehicle.parameters["NAV_DLL_ACT"])
    if not action or commander.station_seen == NEVER:
        return
    if (
        _link_lost(commander)
        and not _outranked(commander, LINK_LOST)
        and commander.requested not in (modes.RTL, modes.LAND)
    ):
        vehicle.send_text(INFO, "Data link lost\t")
        _act(commander, LINK_LOST, action)


def _link_lost(commander: CommanderState) -> bool:
    vehicle = commander.vehicle
    return vehicle.kernel.now() - commander.station_seen > vehicle.seconds_parameter("COM_DL_LOSS_T")


def _check_geofence(commander: CommanderState) -> None:
    """React to a vehicle outside of the geofence, as GF_ACTION states."""
    vehicle = commander.vehicle
    action = round(vehicle.parameters["GF_ACTION"])
    beyond = fence_breach(vehicle, vehicle.estimate.position) if action else ""
    if not beyond or _outranked(commander, OUTSIDE_FENCE):
        return
    if beyond not in vehicle.reports.sent_once:
        vehicle.reports.sent_once.add(beyond)
        _report_breach(vehicle, beyond)
    if action == FENCE_TERMINATE:
        vehicle.send_text(CRITICAL, "Failsafe activated\t")
        commander.terminate()
    elif action in FENCE_ACTIONS and commander.requested not in (modes.RTL, modes.LAND):
        _act(commander, OUTSIDE_FENCE, FENCE_ACTIONS[action])


def _act(commander: CommanderState, name: str, action: int) -> None:
    if action in (TERMINATE, DISARM):
        commander.vehicle.send_text(CRITICAL, "Failsafe activated\t")
        if action == TERMINATE:
            commander.terminate()
        else:
            commander.finish_disarming("failsafe", event_interface.BY_COMMAND)
        return
    number = ACTIONS.get(action, modes.RTL)
    if number == modes.LOITER:
        commander.vehicle.send_text(CRITICAL, "Failsafe activated\t")
        commander.begin_failsafe(name, number)
    else:
        _hold_first(commander, name, number)


LOW, CRITICALLY_LOW, EMERGENCY = "BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR"


def _battery_below(commander: CommanderState, level: str) -> bool:
    return commander.vehicle.estimate.battery_left < commander.vehicle.parameters[level]


def _check_battery(commander: CommanderState) -> None:
    vehicle, left = commander.vehicle, commander.vehicle.estimate.battery_left
    action, words = round(vehicle.parameters["COM_LOW_BAT_ACT"]), commander.version.battery_words
    if left < vehicle.parameters[EMERGENCY]:
        _report_once(vehicle, *words[2])
        if action and not _outranked(commander, BATTERY_EMERGENCY):
            _react_to_battery(commander, BATTERY_EMERGENCY, modes.LAND)
    elif left < vehicle.parameters[CRITICALLY_LOW]:
        _report_once(vehicle, *words[1])
        if action and not _outranked(commander, BATTERY_CRITICAL):
            _react_to_battery(commander, BATTERY_CRITICAL, modes.LAND if action == 2 else modes.RTL)
    elif left < vehicle.parameters[LOW]:
        _report_once(vehicle, *words[0])


def _react_to_battery(commander: CommanderState, name: str, number: int) -> None:
    if commander.requested in (modes.LAND, number):
        return
    if not commander.can_fly(number):
        number = modes.LAND
    _hold_first(commander, name, number)


def _report_once(vehicle: AutopilotVehicle, severity: int, text: str) -> None:
    if text and text not in vehicle.reports.sent_once:
        vehicle.reports.sent_once.add(text)
        vehicle.send_text(severity, text)


def _check_position(commander: CommanderState) -> None:
    """React to a lost position: ALTCTL if the pilot flies, else a level descent."""
    vehicle = commander.vehicle
    flown = commander.failsafe_mode or commander.requested
    lost = not vehicle.has_position
    if commander.failsafe == POSITION_LOST:
        if not lost and not commander.descending:
            commander.resume_requested()
        return
    needs = vehicle.rules.modes[flown].needs_position or flown == modes.LAND
    if not lost or not needs:
        return
    vehicle.send_text(CRITICAL, "Failsafe activated\t")
    if commander.joystick.valid and commander.requested == modes.POSCTL:
        commander.begin_failsafe(POSITION_LOST, modes.ALTCTL)
    else:
        commander.descending = True
        commander.begin_failsafe(POSITION_LOST, modes.LAND)
