"""The heading loop over a radio of 57600 baud with loss: which telemetry rate still leaves it stable.

The same steps of the heading are flown on a simulated ArduCopter over RC override, with our gains and with
those of the thesis, at falling rates of the attitude. IAE is a ratio to that over the fastest telemetry.
"""

from __future__ import annotations

from math import nan

import numpy as np

from volery.control.actuation import RcOverride, thesis_scale
from volery.control.flight import ControlledFlight
from volery.control.laws import DEGREES, PidGains, PidLaw
from volery.control.manoeuvres import THESIS_PID, YAW_GAINS, Rotation
from volery.control.step_response import make_signal, step_responses
from volery.run.connect import connect
from volery.trace.events import ControlSample

RATES = (50, 25, 10, 5, 4, 3, 2)
HEADINGS = (0.0, 45.0, 135.0, 255.0, 75.0)


def flown(rate: float, gains: PidGains, *, thesis: bool, link: str) -> tuple[float, float, float]:
    """Return mean IAE per degree in s, greatest overshoot as a share, and greatest time to 10 % in s."""
    rows: list[tuple[float, float, float]] = []
    url = f"sim:ardupilot?start=warm&attitude={rate}&rate={min(rate, 5)}&{link}"
    with connect(url) as drone:

        def record(event: object) -> None:
            if isinstance(event, ControlSample) and event.loop == "yaw":
                rows.append((event.at / 1e9, event.measurement, event.goal))

        drone.kernel.record = record
        drone.wait_ready()
        actuation = RcOverride(drone, thesis_scale(), gains=None) if thesis else RcOverride(drone)
        turns = Rotation(HEADINGS, 12.0, PidLaw(gains), "PID", holds_place=not thesis)
        ControlledFlight(drone, turns, actuation).run()
    times, measured, goal = np.array(rows).T
    signal = make_signal("yaw", "deg", (times, measured), (times, goal), period=DEGREES)
    found = [one for one in step_responses(signal) if abs(one.size) > 20.0]
    settled = [one.settled_10 for one in found]
    return (
        float(np.mean([one.iae / abs(one.size) for one in found])),
        max(one.overshoot_share for one in found),
        nan if any(np.isnan(settled)) else max(settled),
    )


def main() -> None:
    """Print one table for each law."""
    link = "wire=bytes&baud=57600&drop=0.05"
    for name, gains, thesis in (("ours", YAW_GAINS, False), ("the thesis's", THESIS_PID, True)):
        best = None
        print(f"{name}: 57600 baud, 5 % of frames lost; reference: 50 Hz")
        for rate in RATES:
            iae, overshoot, settled = flown(rate, gains, thesis=thesis, link=link)
            best = best or iae
            state = "never" if np.isnan(settled) else f"{settled:5.2f} s"
            print(f"  {rate:3d} Hz  IAE {iae / best:5.2f} x  overshoot {overshoot:6.1%}  to 10 %: {state}")


if __name__ == "__main__":
    main()
