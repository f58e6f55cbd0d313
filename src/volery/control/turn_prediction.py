"""Prediction of the heading that an autopilot reaches by the turn rates it was already given.

By sticks an autopilot integrates the commanded rate to a target heading, and its own loops follow that target
late and with a swing. A law on the measured heading would answer the swing and feed it. With a model of those
loops the law acts on the measured heading plus what is still to come (O. J. M. Smith, 1957; Åström and
Hägglund, Advanced PID Control, section 8.7); at rest nothing is to come, so the model's error is no offset.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

STEP_S = 0.01


class TurnModel(NamedTuple):
    """How an autopilot follows a commanded turn rate.

    Attributes:
        acceleration: greatest change of the rate of its target, degrees/s^2.
        delay_s: from the command to its effect and back to the measurement, s.
        frequency: natural frequency of its loops about the target, rad/s.
        damping: their damping ratio.
    """

    acceleration: float
    delay_s: float
    frequency: float
    damping: float


class TurnPrediction:
    """The turn that is still to come.

    Args:
        model: model of the autopilot; without one nothing is to come.
    """

    def __init__(self, model: TurnModel | None) -> None:
        self._model = model
        self.reset()

    def reset(self) -> None:
        """Begin anew, at rest."""
        self.lead = 0.0
        """Degrees by which the autopilot will still turn."""
        self._commands: deque[float] = deque()
        self._rate = self._target_rate = self._reached_rate = 0.0
        self._ahead = 0.0  # of the commanded heading over the target
        self._error = 0.0  # of the target over the heading

    def command(self, rate: float, sample_s: float) -> None:
        """Take a command into account.

        Args:
            rate: commanded turn rate, degrees/s, that lasts for the sample.
            sample_s: sample time, s.
        """
        model = self._model
        if model is None:
            return
        most, square = model.acceleration * STEP_S, model.frequency * model.frequency
        for _ in range(max(1, round(sample_s / STEP_S))):
            self._rate += min(most, max(-most, rate - self._rate))
            self._commands.append(rate)
            late = self._commands.popleft() if len(self._commands) > model.delay_s / STEP_S else 0.0
            self._target_rate += min(most, max(-most, late - self._target_rate))
            self._ahead += (self._rate - self._target_rate) * STEP_S
            swing = self._target_rate - self._reached_rate
            self._reached_rate += (
                square * self._error + 2.0 * model.damping * model.frequency * swing
            ) * STEP_S
            self._error += (self._target_rate - self._reached_rate) * STEP_S
        self.lead = self._ahead + self._error
