"""Plots of step responses: a record with its set-point, and several responses above each other.

matplotlib draws them, because a figure for a paper needs its formats (PNG, SVG, PDF) and nothing of a page.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.control.step_response import BANDS, Signal, StepResponse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Judged = tuple[Signal, Sequence[StepResponse]]
"""A signal and the responses found in it."""
FORMATS = (".png", ".svg", ".pdf")
GOAL, MEASURED, BAND = "#8a8f98", "#0b5fa5", "#f2c14e"
COLOURS = ("#c43d3d", "#d98a1f", "#0b5fa5", "#2b8a5c", "#7a4fa3", "#5d6670")
WIDTH, HEIGHT = 10.0, 3.4
"""Size of one plot in inches."""
LEGEND = {"loc": "upper right", "fontsize": 8, "framealpha": 0.9}


def check_format(path: Path) -> None:
    """Raise ``UsageError`` unless the suffix of *path* is one of ``FORMATS`` and its folder exists."""
    if path.suffix not in FORMATS:
        raise UsageError(f"--plot {path}: a figure is a {', '.join(FORMATS)} file")
    if not path.parent.is_dir():
        raise UsageError(f"--plot {path}: there is no folder {path.parent}")


def draw_records(judged: Sequence[Judged], path: Path) -> None:
    """Draw each signal over time with its set-point and the bands of its steps.

    Args:
        judged: signals and their responses, one plot each.
        path: figure to write.
    """
    figure, rows = _figure(len(judged), path)
    for axes, (signal, responses) in zip(rows, judged, strict=True):
        values, goal = _continuous(signal)
        if goal is not None:
            axes.plot(signal.times, goal, color=GOAL, linewidth=1.2, linestyle="--", label="set-point")
        axes.plot(signal.times, values, color=MEASURED, linewidth=1.4, label="measured")
        offsets = np.interp([one.start for one in responses], signal.times, values)
        for number, (one, offset) in enumerate(zip(responses, offsets, strict=True)):
            aim = one.goal + (offset - one.origin)
            band = BANDS[0] * abs(one.size)
            label = "±10 % of the step" if number == 0 else None
            axes.fill_between(
                [one.start, one.end], aim - band, aim + band, color=BAND, alpha=0.35, linewidth=0, label=label
            )
        _label(axes, f"{signal.name} [{signal.unit}]" if signal.unit else signal.name, signal.controller)
    rows[-1].set_xlabel("time [s]")
    figure.savefig(path)


def draw_comparison(judged: Sequence[Judged], path: Path) -> None:
    """Draw the responses of several controllers above each other, one plot for each size of a step.

    Args:
        judged: signals and their responses; the name is the signal's controller.
        path: figure to write.
    """
    sizes = sorted({_nominal(one) for _, responses in judged for one in responses})
    if not sizes:
        raise UsageError("there is no step to compare; --step gives the least size of one")
    figure, rows = _figure(len(sizes), path)
    names = list(dict.fromkeys(signal.controller or signal.name for signal, _ in judged))
    for axes, size in zip(rows, sizes, strict=True):
        shown: set[str] = set()
        for signal, responses in judged:
            name = signal.controller or signal.name
            colour = COLOURS[names.index(name) % len(COLOURS)]
            for one in responses:
                if _nominal(one) != size:
                    continue
                part = signal.between(one.start, one.end)
                values, _ = _continuous(part)
                moved = (values - values[0]) * np.sign(one.size)
                label = None if name in shown else name
                axes.plot(part.times - one.start, moved, color=colour, linewidth=1.3, label=label)
                shown.add(name)
        axes.axhline(size, color=GOAL, linestyle="--", linewidth=1.0)
        axes.axhspan(size * 0.9, size * 1.1, color=BAND, alpha=0.25, linewidth=0)
        _label(axes, f"moved [{judged[0][0].unit}]", f"step of {size:g} {judged[0][0].unit}")
    rows[-1].set_xlabel("time after the step [s]")
    figure.savefig(path)


def _nominal(response: StepResponse) -> float:
    """Return the size of a step without its sign, rounded to two digits so that repeated steps are one."""
    return float(f"{abs(response.size):.2g}")


def _figure(rows: int, path: Path) -> tuple[Figure, list[Any]]:
    require_extra("control", "plots")
    check_format(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT * rows), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(rows, 1, row + 1) for row in range(rows)]


def _continuous(signal: Signal) -> tuple[Any, Any]:
    """Return measurement and set-point without the jumps of an angle that passes its largest value."""
    if signal.period is None:
        return signal.measured, signal.goal
    values = np.unwrap(signal.measured, period=signal.period)
    if signal.goal is None:
        return values, None
    turns = np.round((values - signal.goal) / signal.period)
    return values, signal.goal + turns * signal.period


def _label(axes: Any, unit: str, title: str) -> None:
    axes.set_ylabel(unit)
    axes.set_title(title, fontsize=10, loc="left")
    axes.grid(visible=True, color="#e3e6ea", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(**LEGEND)
