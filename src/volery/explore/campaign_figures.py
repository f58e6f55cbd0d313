"""Figures of a campaign's page as SVG: parallel coordinates, Pareto fronts, distributions, tornado charts.

matplotlib draws them. Its colours are replaced by those of the page's style, so that the figures follow light
and dark mode. The same values give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.base.installed import require_extra
from volery.explore.statistics import Interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

require_extra("explore", "figures of campaigns")  # but matplotlib, 40 MB, is imported when it draws

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]

WIDTH, HEIGHT = 6.2, 3.3
"""Size of a figure in inches: its text is readable on a telephone, and two stand side by side on a desk."""
MOST_LINES = 1_500
"""Runs that parallel coordinates and clouds of points draw: more make the page slow and nothing clearer."""
_INK, _SOFT, _LINE, _ACCENT, _BAD, _SURFACE = "#010203", "#010204", "#010205", "#010206", "#010207", "#010208"
_VARIABLES = {_INK: "ink", _SOFT: "soft", _LINE: "line", _ACCENT: "accent", _BAD: "bad", _SURFACE: "surface"}
"""What stands for each colour of the style while matplotlib draws."""
_BEHIND: dict[str, Any] = {"facecolor": _SURFACE, "alpha": 0.85, "edgecolor": "none", "pad": 1.5}
"""A text stays readable on lines."""


@dataclass(frozen=True)
class Axis:
    """One quantity of all runs.

    Attributes:
        name: What the reader knows it by, with its unit.
        values: One for each run; NaN where the run has none. For a choice: the index into ``choices``.
        choices: Names of the values of a parameter that is chosen, in order; empty for numbers.
    """

    name: str
    values: Values
    choices: tuple[str, ...] = ()


def thinned(count: int, keep: Flags) -> NDArray[np.int64]:
    """Return the indices of at most ``MOST_LINES`` of *count* runs: those to *keep*, and others evenly."""
    chosen = np.flatnonzero(keep)[:MOST_LINES]
    others = np.flatnonzero(~keep)
    room = MOST_LINES - len(chosen)
    if len(others) > room:
        others = others[np.linspace(0, len(others) - 1, room).astype(np.int64)] if room else others[:0]
    return np.sort(np.concatenate([chosen, others])).astype(np.int64)


def parallel_coordinates(axes: Sequence[Axis], met: Flags, marked: Flags) -> str:
    """Draw one line for each run through all *axes*.

    Args:
        axes: Parameters first, then what was observed; at least two.
        met: Which runs met all requirements; the others are drawn in red.
        marked: Which runs to draw strongly, such as those of a Pareto front.
    """
    figure, plot = _figure(width=2.1 * WIDTH, height=1.15 * HEIGHT)
    scaled = np.column_stack([_to_unit(axis.values) for axis in axes])
    places = np.arange(len(axes))
    for index in thinned(len(scaled), marked):
        strong = bool(marked[index])
        plot.plot(
            places,
            scaled[index],
            color=_ACCENT if met[index] else _BAD,
            linewidth=1.6 if strong else 0.7,
            alpha=0.95 if strong else 0.3,
            zorder=3 if strong else 2,
        )
    plot.set_xlim(-0.25, len(axes) - 0.75)
    plot.set_ylim(-0.08, 1.08)
    plot.set_yticks([])
    plot.set_xticks(places, [_wrapped(axis.name) for axis in axes])
    plot.spines["left"].set_visible(False)
    for place, axis in enumerate(axes):
        plot.axvline(place, color=_SOFT, linewidth=0.8, zorder=1)
        for height, text in _marks(axis):
            plot.text(place + 0.03, height, text, color=_INK, fontsize=8, va="center", zorder=4, bbox=_BEHIND)
    return _svg(figure, f"one line a run through {', '.join(axis.name for axis in axes)}")


def pareto_plot(
    across: Axis,
    up: Axis,
    front: Flags,
    links: Mapping[int, str],
    bands: Mapping[int, tuple[Interval, Interval]],
) -> str:
    """Draw two objectives against each other and mark the runs of the *front*.

    Args:
        across: Objective to the right.
        up: Objective upwards.
        front: Which runs are not dominated.
        links: Where a click on each run that is drawn leads, by index; "" for nowhere.
        bands: Intervals of both objectives of runs of the front, by index.
    """
    figure, plot = _figure()
    shown = thinned(len(across.values), front)
    behind = [index for index in shown if not front[index]]
    _cloud(plot, across.values, up.values, behind, links, color=_SOFT, size=10, alpha=0.5)
    best = [index for index in shown if front[index]]
    for index in best:
        if index in bands:
            x, y = bands[index]
            plot.plot([x.low, x.high], [y.estimate, y.estimate], color=_ACCENT, linewidth=0.9, alpha=0.7)
            plot.plot([x.estimate, x.estimate], [y.low, y.high], color=_ACCENT, linewidth=0.9, alpha=0.7)
    _cloud(plot, across.values, up.values, best, links, color=_ACCENT, size=26, alpha=1.0)
    _axis(plot.set_xlabel, plot.set_xticks, across)
    _axis(plot.set_ylabel, plot.set_yticks, up)
    plot.grid(visible=True, color=_LINE, linewidth=0.7)
    return _svg(figure, f"{up.name} against {across.name}; {len(best)} runs are not dominated")


def distribution_plot(axis: Axis, bounds: Sequence[float] = ()) -> str:
    """Draw how often each value occurs, with median and 95 % quantile, and the *bounds* of requirements."""
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415  # see above

    figure, plot = _figure(height=0.8 * HEIGHT)
    values = axis.values[np.isfinite(axis.values)]
    if axis.choices:
        plot.bar(
            range(len(axis.choices)),
            [int(np.sum(values == index)) for index in range(len(axis.choices))],
            color=_ACCENT,
            alpha=0.55,
        )
    else:
        if len(values) and np.ptp(values) > 1e-9 * np.max(np.abs(values)):
            plot.hist(values, bins=min(40, max(5, int(np.sqrt(len(values))))), color=_ACCENT, alpha=0.55)
        elif len(values):
            plot.bar(
                [values[0]], [len(values)], width=max(abs(values[0]), 1.0) * 0.02, color=_ACCENT, alpha=0.55
            )
        for share, style in ((50, "-"), (95, "--")) if len(values) else ():
            place = float(np.percentile(values, share))
            plot.axvline(place, color=_INK, linewidth=1.0, linestyle=style, label=_quantile(share, place))
        for number, bound in enumerate(bounds):
            label = "required" if number == 0 else None
            plot.axvline(bound, color=_BAD, linewidth=1.4, linestyle=":", label=label)
        if len(values):
            plot.legend(
                fontsize=8,
                frameon=False,
                labelcolor=_SOFT,
                loc="lower right",
                bbox_to_anchor=(1.0, 0.98),
                ncols=3,
            )
    _axis(plot.set_xlabel, plot.set_xticks, axis)
    plot.set_ylabel("runs")
    plot.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    return _svg(figure, f"distribution of {axis.name} over {len(values)} runs")


def tornado_chart(effects: Mapping[str, Interval], title: str) -> str:
    """Draw the effect of each parameter as a bar with its interval, the largest at the top.

    Args:
        effects: Effect of each parameter by its name.
        title: What is drawn; it is read aloud, and stands on the page already.
    """
    ranked = sorted(effects.items(), key=lambda item: abs(item[1].estimate))
    figure, plot = _figure(height=max(1.3, 0.34 * len(ranked) + 0.8))
    for place, (_, effect) in enumerate(ranked):
        plot.barh(place, effect.estimate, height=0.62, color=_ACCENT, alpha=0.55)
        plot.plot([effect.low, effect.high], [place, place], color=_INK, linewidth=1.2)
    plot.axvline(0.0, color=_SOFT, linewidth=0.8)
    plot.set_yticks(range(len(ranked)), [name for name, _ in ranked])
    return _svg(
        figure, f"{title}: " + ", ".join(f"{name} {effect.estimate:.3g}" for name, effect in reversed(ranked))
    )


def _figure(width: float = WIDTH, height: float = HEIGHT) -> tuple[Figure, Axes]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415  # see above
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    plot = figure.add_subplot()
    plot.set_facecolor("none")
    plot.spines[["top", "right"]].set_visible(False)
    for spine in plot.spines.values():
        spine.set_color(_SOFT)
    plot.tick_params(colors=_SOFT, labelsize=9)
    plot.xaxis.label.set_color(_INK)
    plot.yaxis.label.set_color(_INK)
    return figure, plot


def _cloud(
    plot: Axes,
    x: Values,
    y: Values,
    indices: Sequence[Any],
    links: Mapping[int, str],
    *,
    color: str,
    size: int,
    alpha: float,
) -> None:
    points = plot.scatter(x[indices], y[indices], s=size, color=color, alpha=alpha, linewidths=0)
    points.set_urls([links[index] or None for index in indices])


def _to_unit(values: Values) -> Values:
    """Return values scaled to 0..1; those that are all equal lie in the middle."""
    known = values[np.isfinite(values)]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    return (values - low) / (high - low) if high > low else np.where(np.isfinite(values), 0.5, np.nan)


def _marks(axis: Axis) -> list[tuple[float, str]]:
    known = axis.values[np.isfinite(axis.values)]
    if not len(known):
        return [(0.5, "none")]
    low, high = float(known.min()), float(known.max())
    if axis.choices:
        span = high - low
        used = sorted({int(one) for one in known})
        return [((one - low) / span if span else 0.5, axis.choices[one]) for one in used]
    return [(0.5, f"{low:.4g}")] if high == low else [(-0.05, f"{low:.4g}"), (1.05, f"{high:.4g}")]


def _axis(label: Callable[[str], Any], ticks: Callable[..., Any], axis: Axis) -> None:
    label(axis.name)
    if axis.choices:
        ticks(range(len(axis.choices)), axis.choices)


def _wrapped(name: str) -> str:
    """Break a long path of the model at its dots."""
    lines = [""]
    for part in re.split(r"(?<=[. ])", name):
        if lines[-1] and len(lines[-1]) + len(part) > 18:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def _quantile(share: int, value: float) -> str:
    return f"median {value:.4g}" if share == 50 else f"p{share} {value:.4g}"


def _svg(figure: Figure, description: str) -> str:
    """Return the figure as an element of a page, in the colours of the page's style."""
    from matplotlib import rc_context  # noqa: PLC0415  # see above

    text = StringIO()
    # text stays text, so that it is found and read aloud; the salt makes names of elements the same each time
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": description}):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    for colour, variable in _VARIABLES.items():
        svg = svg.replace(colour, f"var(--{variable})")
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', _opening(description), svg, count=1)
    svg = re.sub(r' id="[\w.]+_\d+"', "", svg)  # not unique in a page of several figures
    return re.sub(r"font: ([^;\"]*?)'[^;\"]*", r"font: \1var(--font)", svg)


def _opening(description: str) -> Callable[[re.Match[str]], str]:
    def opening(found: re.Match[str]) -> str:
        label = escape(description, quote=True)
        return (
            f'<svg role="img" aria-label="{label}" viewBox="{found[1]}" xmlns="http://www.w3.org/2000/svg" '
            'xmlns:xlink="http://www.w3.org/1999/xlink">'
        )

    return opening
