"""The heading loop over a radio of 57600 baud with loss: which telemetry rate still leaves it stable.

The same steps of the heading are flown on a simulated ArduCopter over RC override, with our gains and with
those of the thesis, at falling rates of the attitude. IAE is a ratio to that over the fastest telemetry.
"""

from __future__ import annotations

import argparse
from math import nan
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

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
        actuation = RcOverride(drone, thesis_scale() if thesis else None, gains=None)
        turns = Rotation(HEADINGS, 12.0, PidLaw(gains), "PID", holds_place=False)
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


LAWS = (("ours", YAW_GAINS, False), ("the thesis's", THESIS_PID, True))
Row = tuple[float, float, float, float]
"""Rate in Hz, IAE as a ratio to that at 50 Hz, greatest overshoot as a share, time to 10 % in s."""


def draw(tables: dict[str, list[Row]], path: Path) -> None:
    """Draw IAE, overshoot and settling time over the rate into *path*."""
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    axes = figure.subplots(1, 3)
    titles = ("IAE, ratio to 50 Hz", "greatest overshoot, share of the step", "within 10 % after, s")
    for name, rows in tables.items():
        rates = [row[0] for row in rows]
        for axis, title, column in zip(axes, titles, (1, 2, 3), strict=True):
            axis.semilogx(rates, [row[column] for row in rows], "o-", label=name)
            axis.set(title=title, xlabel="attitude reports, Hz", ylim=(0.0, None))
            axis.set_xticks(RATES, [str(rate) for rate in RATES])
            axis.minorticks_off()
            axis.grid(alpha=0.3)
    axes[0].legend(title="gains")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print one table for each law."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", type=Path, help="file for the figure, such as slow-radio.png")
    plot = parser.parse_args().plot
    link = "wire=bytes&baud=57600&drop=0.05"
    tables: dict[str, list[Row]] = {}
    for name, gains, thesis in LAWS:
        rows = tables[name] = []
        print(f"{name}: 57600 baud, 5 % of frames lost; reference: 50 Hz")
        for rate in RATES:
            iae, overshoot, settled = flown(rate, gains, thesis=thesis, link=link)
            best = rows[0][1] if rows else iae
            rows.append((rate, iae, overshoot, settled))
            state = "never" if np.isnan(settled) else f"{settled:5.2f} s"
            ratio = f"IAE {iae / best:5.2f} x"
            print(f"  {rate:3d} Hz  {ratio}  overshoot {overshoot:6.1%}  to 10 %: {state}", flush=True)
        tables[name] = [(rate, iae / rows[0][1], over, settled) for rate, iae, over, settled in rows]
    if plot is not None:
        draw(tables, plot)


if __name__ == "__main__":
    main()
