"""A vehicle of a fleet whose autopilot is a real firmware, in lock step with virtual time.

Virtual time moves the body, and the body's exchanges move the firmware: see ``World.attend``. A firmware
that was warmed up has a clock that began before the run; its body rests meanwhile.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import nan
from random import Random

from volery.base.errors import UsageError
from volery.base.frames import Vector
from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.links.mavlink_messages import message_type
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware.firmware_faults import FirmwareFaults
from volery.simulation.real_firmware.firmware_instance import FirmwareInstance
from volery.simulation.real_firmware.ground_link import GroundLink
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_BARO,
    M_BARO_COUNT,
    M_GPS_COUNT,
    M_GYRO,
    M_MAG,
    M_MAG_COUNT,
    P_ACCEL_ERROR,
    P_BARO_ERROR,
    P_GYRO_ERROR,
    P_MAG_ERROR,
    WHITE_SIGMA,
)
from volery.simulation.world.world import STEP
from volery.trace.events import Text, VehicleState

READ_EVERY: Ns = 10 * MS
"""Time between two readings of the telemetry port."""
WARM_UP_LIMIT: Ns = 120 * S
"""Longest time on the firmware's clock from its start until it can fly."""
_NOISY = (
    (M_GYRO, 3, P_GYRO_ERROR),
    (M_ACCEL, 3, P_ACCEL_ERROR),
    (M_MAG, 3, P_MAG_ERROR),
    (M_BARO, 1, P_BARO_ERROR),
)
"""First column and number of what is noisy at rest, and the columns of its error."""
_COUNTS = ((M_BARO_COUNT, 50 * MS), (M_MAG_COUNT, 50 * MS), (M_GPS_COUNT, 200 * MS))
"""Columns that count samples, and the time between two."""
_NOWHERE: Vector = (nan, nan, nan)


class RealFirmware:
    """A ``FleetAutopilot`` that is a program.

    Args:
        kernel: Clock and timers.
        flight: The body.
        instance: The firmware, just started.
        name: Name of the vehicle.
        project: That of the firmware.
        random: Noise of the samples while it warms up.
    """

    banner = b""

    def __init__(
        self,
        kernel: Kernel,
        flight: Flight,
        instance: FirmwareInstance,
        name: str,
        project: str,
        random: Random,
    ) -> None:
        self.transmitter: MutableSequence[int] = [0] * 16
        self.next_step = 0
        """See ``Attendant``."""
        self.process = instance.process
        """The program."""
        self._kernel, self._flight, self._name, self._random = kernel, flight, name, random
        self._exchange, self._mode_name, self._kinds = instance.exchange, instance.mode_name, instance.kinds
        self._arms_lost = instance.arms_lost
        self._ground = GroundLink(instance.connection, flight.frame, self._meet)
        whose = f"{name}: {self.process.program}"
        self._faults = FirmwareFaults(project, whose, self._ground, instance.parameters)
        self._clock: Ns = 0  # the firmware's time at its last exchange
        self._due: Ns = 0  # virtual time of its next one
        self._waiting = False  # for the answer to the last samples
        self._answer: Sequence[float] | None = None
        self._started = False
        self._status_requested = False
        self._reading: Handle | None = None

    @property
    def version(self) -> str:
        """Its version as it states it, such as ``4.6.3 (92b0cd78)``; empty: not stated yet."""
        return self._ground.reported.version

    # -- life

    def start(self, *, warm: bool) -> None:
        """Let its time begin now, or, *warm*, before now so that it is ready.

        Raises:
            FirmwareError: It ends, does not answer, is for another vehicle, or does not get ready.
        """
        self._started = True
        if warm:
            self._warm_up()
        self._flight.drive_motors([0.0] * (self._flight.rotors or 2))
        self._due = -(-self._kernel.now() // self._exchange.period) * self._exchange.period
        self.next_step = self._due // STEP
        self._flight.attend(self)
        self._reading = self._kernel.every(READ_EVERY, self._read)

    def _warm_up(self) -> None:
        resting, reported = list(self._flight.row), self._ground.reported
        while not (reported.ready and (reported.located or not self._arms_lost) and self._faults.settled):
            if self._clock > WARM_UP_LIMIT:
                raise self.process.error(
                    f"does not get ready to arm: {reported.complaint or 'it says nothing'}"
                )
            row = list(resting)
            for column, width, sigmas in _NOISY:
                for axis in range(column, column + width):
                    row[axis] += self._random.gauss(0.0, row[sigmas + WHITE_SIGMA])
            for count, period in _COUNTS:
                if self._clock % period < self._exchange.period:
                    resting[count] += 1.0
            self._exchange_now(row, 0.0)
            if self._clock % READ_EVERY < self._exchange.period:
                self._settle()
                self._ground.read()
                self._check_kind()
                self._request_status()
                self._faults.ask(self._clock)

    def _check_kind(self) -> None:
        kind = self._ground.reported.kind
        if kind >= 0 and kind not in self._kinds:
            body = "multirotor" if self._flight.flying else "rover"
            raise self.process.error(f"is no firmware of a {body} (MAV_TYPE {kind})")

    def _request_status(self) -> None:
        """Ask once for the message that says whether it is ready: some send it when asked only."""
        if self._clock > S and not self._status_requested:
            self._status_requested = True
            self._ground.request("SYS_STATUS", S // 2)
            if self._arms_lost:
                self._ground.request("EKF_STATUS_REPORT", S // 2)
            self._ground.command("MAV_CMD_REQUEST_MESSAGE", float(message_type("AUTOPILOT_VERSION").id))

    def attend(self) -> None:
        """See ``Attendant``: take the last answer for the motors, and send the present samples."""
        self._exchange_now(self._flight.row, 1e-9 * (self._due - self.next_step * STEP))
        if self._answer is not None:
            self._flight.command_motors(self._answer)
        self._due += self._exchange.period
        self.next_step = self._due // STEP

    def _exchange_now(self, row: Sequence[float], ahead: float) -> None:
        """Take the answer to the last samples and send the next, which are made while it still computes."""
        self._clock += self._exchange.period
        try:
            self._exchange.prepare(self._clock, row, ahead)
            self._settle()
            self._exchange.send()
        except BaseException:
            self._flight.attend(None)
            raise
        self._waiting = True

    def _settle(self) -> None:
        """Wait until it has answered, and waits for its next samples."""
        if self._waiting:
            self._waiting = False  # a firmware that has failed is not asked again
            try:
                self._answer = self._exchange.receive()
            except BaseException:
                self._flight.attend(None)
                raise

    def _meet(self) -> None:
        """Let the firmware reach the present and wait there."""
        self._flight.advance()
        self._settle()

    def _read(self) -> None:
        self._meet()
        self._ground.read()
        self._faults.act(self._clock, self._flight.row)
        texts = self._ground.reported.texts
        while texts:
            severity, text = texts.pop(0)
            self._kernel.record(Text(self._kernel.now(), self._name, severity, text))
        if any(self.transmitter) and not self._flight.transmitter_blocked:
            self._exchange.transmit(self.transmitter)

    def swap_battery(self) -> None:
        """Fly on a full battery from now on."""
        self._flight.set_charge(1.0)

    def require(self, kind: str, fault: str) -> None:
        """Refuse a fault of the world that this firmware cannot be given; see ``FirmwareFaults``.

        Raises:
            CapabilityError: It cannot; if it still boots, this is raised when its parameters are known.
        """
        self._faults.require(kind, fault)

    def close(self) -> None:
        """End the program. The state can still be read."""
        self._flight.attend(None)
        if self._reading is not None:
            self._reading.cancel()
        self._ground.close()
        self.process.end()

    # -- as a vehicle of a fleet

    def connect(self, link: Link, *, use: str = "") -> None:
        """See ``FleetAutopilot``."""
        self._ground.connect(link)
        if not self._started:
            self.start(warm=False)

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """See ``FleetAutopilot``."""
        raise UsageError(f"{self._name}: {self.process.program} is reached over links")

    def state(self) -> VehicleState:
        """See ``FleetAutopilot``."""
        seen, reported = self._flight.truth(), self._ground.reported
        return VehicleState(
            self._kernel.now(),
            self._name,
            *seen.position,
            *seen.attitude,
            *seen.velocity,
            *(reported.position or _NOWHERE),
            seen.battery_left,
            seen.volts,
            seen.amps,
            reported.armed,
            self._mode_name(reported.custom_mode),
        )
