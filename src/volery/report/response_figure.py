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
from volery.control.step_response import BANDS, ControlledSignal, StepResponse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Judged = tuple[ControlledSignal, Sequence[StepResponse]]
"""A signal and the responses found in it."""
FORMATS = (".png", ".svg", ".pdf")
GOAL, MEASURED, BAND = "#8a8f98", "#0b5fa5", "#f2c14e"
COLOURS = ("#c43d3d", "#d98a1f", "#0b5fa5", "#2b8a5c", "#7a4fa3", "#5d6670")
WIDTH, HEIGHT = 10.0, 2.7
"""Size of one plot in inches."""
LEGEND: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "fontsize": 8, "frameon": False}
"""The legend stands above its plot, where it hides nothing."""


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
        offsets = np.interp([response.start for response in responses], signal.times, values)
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
    """Draw the responses of several controllers above each other, one plot for each step in order.

    Args:
        judged: signals and their responses; the name is the signal's controller.
        path: figure to write.
    """
    count = max((len(responses) for _, responses in judged), default=0)
    if not count:
        raise UsageError("there is no step to compare; --step gives the least size of one")
    figure, rows = _figure(count, path)
    names = list(dict.fromkeys(signal.controller or signal.name for signal, _ in judged))
    for number, axes in enumerate(rows):
        longest = 0.0
        for signal, responses in judged:
            if number >= len(responses):
                continue
            name, one = signal.controller or signal.name, responses[number]
            part = signal.between(one.start, one.end)
            values, _ = _continuous(part)
            left = (values - values[0] - one.size) * np.sign(one.size)
            colour = COLOURS[names.index(name) % len(COLOURS)]
            axes.plot(part.times - one.start, left, color=colour, linewidth=1.4, label=name)
            longest = max(longest, abs(one.size))
        axes.axhline(0.0, color=GOAL, linestyle="--", linewidth=1.0)
        axes.axhspan(-0.1 * longest, 0.1 * longest, color=BAND, alpha=0.25, linewidth=0)
        _label(axes, f"from set-point [{judged[0][0].unit}]", f"step {number + 1}, with ±10 % of it")
    rows[-1].set_xlabel("time after the step [s]")
    figure.savefig(path)


def _figure(rows: int, path: Path) -> tuple[Figure, list[Any]]:
    require_extra("control", "plots")
    check_format(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT * rows), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(rows, 1, row + 1) for row in range(rows)]


def _continuous(signal: ControlledSignal) -> tuple[Any, Any]:
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
        axes.legend(**LEGEND, ncols=len(handles))
