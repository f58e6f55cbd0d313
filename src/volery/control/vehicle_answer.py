"""How vehicles answer the commands of a law, and gains that suit such an answer.

A law commands a velocity, and the measured position follows it late: the autopilot's own loops, the link, and
the time between two reports of telemetry. The gains of a loop are those of the manoeuvre where the loop is
robust with them, else the largest share of them that is. Robust means the bounds of ``tuning``: a gain margin
of 2, a phase margin of 45 degrees and a sensitivity Ms of at most 2 (Astrom, Panagopoulos and Hagglund,
Automatica 34 (1998) 585). A share of a law is the same law on a slower time scale: kp by the share, ki by its
square.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import NamedTuple

from volery.control.laws import PidGains
from volery.control.tuning import Process, is_robust


class LoopAnswer(NamedTuple):
    """How a vehicle answers the commands of a law, one process for each kind of loop.

    Their dead times are those without the wait for the next report of telemetry.

    Attributes:
        plane: from a velocity to a position, north or east.
        climb: from a climb rate to a height.
        turn: from a turn rate to a heading.
        velocity_within_s: greatest time between two reports of the velocity that this steering bears, s.
    """

    plane: Process
    climb: Process
    turn: Process
    velocity_within_s: float = inf

    def of(self, loop: str) -> Process | None:
        """Return the process of a loop by its name; ``None`` for a loop of another kind."""
        return {"north": self.plane, "east": self.plane, "altitude": self.climb, "yaw": self.turn}.get(loop)


PREDICTED = Process(1.0, 50.0, 1.0, 0.02)
"""A heading under ``turn_prediction``: to the law it is where it will be."""
PREDICTED_WITHIN_S = 0.1
"""Greatest time between two reports of the heading with which a prediction is of use."""
TILT_WITHIN_S = 0.34
"""Greatest time between two reports of the velocity for a velocity loop on this side: a gain of 2 /s from
velocity to acceleration, an attitude that follows after 0.2 s, and a gain margin of 2 leave 0.39 s of delay
in all, and a report is late by half of its period on average.
"""

VELOCITY_ANSWERS: Mapping[str, LoopAnswer] = {
    "ArduPilot": LoopAnswer(
        Process(0.95, 18.0, 0.32, 0.4),
        Process(1.0, 9.8, 1.1, 0.28),
        Process(1.0, 4.7, 0.32, 0.01),
    ),
    "PX4": LoopAnswer(
        Process(0.81, 5.8, 1.75, 0.0),
        Process(0.97, 12.0, 1.6, 0.0),
        Process(0.97, 8.8, 1.75, 0.0),
    ),
    "DJI": LoopAnswer(
        Process(0.95, 28.0, 0.32, 0.38),
        Process(1.0, 9.8, 1.1, 0.28),
        Process(1.0, 6.5, 0.4, 0.13),
    ),
    # GUIDANCE_H_REF_* and the loops behind the reference: soft, with a swing of 1.35 rad/s
    "Paparazzi": LoopAnswer(
        Process(1.2, 1.35, 0.32, 0.41),
        Process(0.98, 5.8, 0.32, 0.0),
        Process(1.0, 6.5, 0.43, 0.1),
    ),
}
"""Answers to velocity set-points, fitted by ``tuning.fit_process`` to random steps of 1 m/s, 0.6 m/s of
climb and 30 degrees/s that the simulated autopilots have flown.
"""
SLOWEST = VELOCITY_ANSWERS["Paparazzi"]
"""Answer that is assumed of an autopilot without one here."""
TILT_ANSWERS: Mapping[str, LoopAnswer] = {
    "ArduPilot": LoopAnswer(
        Process(0.93, 3.1, 0.37, 0.18),
        Process(1.0, 9.8, 1.1, 0.3),
        Process(1.0, 11.0, 1.75, 0.19),  # of 4.8, which follows turns later than 4.5
        TILT_WITHIN_S,
    ),
    "PX4": LoopAnswer(
        Process(0.92, 3.1, 0.32, 0.22),
        Process(1.0, 2.5, 0.46, 0.0),
        Process(1.0, 6.5, 0.4, 0.07),
        TILT_WITHIN_S,
    ),
    "DJI": LoopAnswer(
        Process(0.9, 2.8, 0.32, 0.19),
        Process(1.0, 9.8, 1.1, 0.28),
        Process(1.0, 6.5, 0.4, 0.1),
        TILT_WITHIN_S,
    ),
}
"""Answers through a velocity loop on this side, by attitude set-points or RC override."""
SHARES = 32
LEAST_SHARE = 1.0 / 16.0
"""Share of the gains below which a law is refused: it would take minutes for a step."""


def answer_of(answers: Mapping[str, LoopAnswer], autopilot: str) -> LoopAnswer:
    """Return the answer of an autopilot by its name, such as ``DJI A3``."""
    return answers.get(autopilot.partition(" ")[0], SLOWEST)


def suited(gains: PidGains, process: Process, reports_s: float, sample_s: float) -> tuple[PidGains, float]:
    """Return gains that suit a vehicle, and the share of *gains* that they are.

    Args:
        gains: gains of a vehicle that answers fast and reports often.
        process: answer of the vehicle.
        reports_s: time between two reports of the measurement, s; NaN where it is not known.
        sample_s: sample time of the law, s.

    Returns:
        The gains, and their share from 0 (none is robust) to 1.
    """
    if isfinite(reports_s):
        process = process._replace(dead_s=process.dead_s + reports_s / 2.0)
        gains = replace(gains, filter_s=max(float(gains.filter_s), min(reports_s, 1.0)))
    low, high = 0, SHARES + 1  # none is robust at *high*; all are up to *low*
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_robust(_share(gains, middle), process, sample_s) else (low, middle)
    return _share(gains, low), low / SHARES


def _share(gains: PidGains, parts: int) -> PidGains:
    share = parts / SHARES
    if parts == SHARES:
        return gains
    return replace(gains, kp=gains.kp * share, ki=gains.ki * share * share, kd=gains.kd * share)
