"""ArduPilot's buttons: pins whose change is reported and runs an auxiliary function.

A pin is high where its bit in SIM_PIN_MASK is set, as in ArduPilot's own simulator. Contacts do not bounce
here, so a change counts at the next tick.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from volery.base.time import Ns, S, from_seconds
from volery.simulation.autopilots.ardupilot.auxiliary import run_function
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.mavlink.messages import boot_ms
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

BUTTONS = 4
INVERTED = 1 << 1
"""Bit of BTN_OPTIONSn."""
REPORTED_EVERY = S
"""Time between two reports of one change, which end BTN_REPORT_SEND seconds after it."""


@dataclass
class ButtonState:
    """Buttons on the pins of an autopilot."""

    pressed: int | None = None
    """One bit for each button whose pin is high; ``None`` until they are first read."""
    changed_at: Ns = NEVER
    changed_ms: int = 0
    """Time of the last change, and the same since boot [ms]."""
    reported_at: Ns = NEVER
    on: set[int] = field(default_factory=set)
    """Buttons whose function has last run as pressed, from 0."""


buttons_of = Kept(ButtonState)


def read_buttons(vehicle: AutopilotVehicle) -> None:
    """Report the buttons after a change, and run their functions; after a boot also without a change."""
    parameters, state = vehicle.parameters, buttons_of(vehicle)
    if not parameters["BTN_ENABLE"]:
        return
    pressed, now = _pressed(vehicle), vehicle.kernel.now()
    first = state.pressed is None
    changed = not first and pressed != state.pressed
    state.pressed = pressed
    if changed:
        state.changed_at, state.changed_ms = now, boot_ms(vehicle)
    lasts = state.changed_at != NEVER and now - state.changed_at < from_seconds(parameters["BTN_REPORT_SEND"])
    if lasts and (state.reported_at == NEVER or now - state.reported_at >= REPORTED_EVERY):
        state.reported_at = now
        fields = {"time_boot_ms": boot_ms(vehicle), "last_change_ms": state.changed_ms, "state": pressed}
        vehicle.output.send_event("BUTTON_CHANGE", fields)
    if first or changed:
        _run_functions(vehicle, pressed, every=first)


def _pressed(vehicle: AutopilotVehicle) -> int:
    """Return the buttons whose pins are high, one bit each."""
    parameters = vehicle.parameters
    pins = round(parameters["SIM_PIN_MASK"])
    numbers = (round(parameters[f"BTN_PIN{number + 1}"]) for number in range(BUTTONS))
    return sum((pins >> pin & 1) << number for number, pin in enumerate(numbers) if pin >= 0)


def _run_functions(vehicle: AutopilotVehicle, pressed: int, *, every: bool) -> None:
    """Run the functions of buttons that differ from when they last ran, or of every button."""
    already = buttons_of(vehicle).on
    for number in range(BUTTONS):
        function = round(vehicle.parameters[f"BTN_FUNC{number + 1}"])
        if not function:
            continue
        on = bool(pressed >> number & 1)
        if round(vehicle.parameters[f"BTN_OPTIONS{number + 1}"]) & INVERTED:
            on = not on
        if every or on != (number in already):
            (already.add if on else already.discard)(number)
            run_function(vehicle, function, 1 if on else -1)


COPTER = ROVER = Feature(
    parameters={
        "BTN_ENABLE": ("", "any value but 0: buttons are read"),
        "BTN_REPORT_SEND": ("s", "time after a change for which BUTTON_CHANGE is repeated"),
        **{f"BTN_PIN{number}": ("", "pin of that button; -1: none") for number in range(1, 5)},
        **{f"BTN_FUNC{number}": ("", "function of that button, as RCn_OPTION") for number in range(1, 5)},
        **{f"BTN_OPTIONS{number}": ("", "bit 1 inverts that button") for number in range(1, 5)},
    },
    on_tick=read_buttons,
)
