"""The law that scales a stated execution time and energy to another frequency.

Law: an operation takes a constant number of cycles, so t(f) = t0 f0 / f; each cycle takes a constant energy,
so E(f) = E0. Both are exact at the stated frequency f0.

Limits: memory does not scale with the core, so the time at a higher frequency is more than this by the share
of memory stalls, and at a lower frequency less. Energy per cycle follows C V^2 (dynamic power C V^2 f, e.g.
Weste and Harris, CMOS VLSI Design, 4th ed., section 5.2) and the supply voltage falls with the frequency
where the computer scales it, so E is an upper bound below f0 and a lower bound above it. Idle power is not in
it.

To another kind of processor nothing is scaled: cycles per instruction differ. It needs an entry of its own.
"""

from __future__ import annotations

from dataclasses import replace

from volery.base.errors import EstimateError
from volery.model.system import Component, Figure, Processor


def figure_for(component: Component, operation: str, processor: Processor) -> Figure:
    """What *operation* takes on *processor*; ``EstimateError`` names what is missing."""
    figures = component.operations.get(operation, ())
    return _scaled(figures, f"{component.name}.{operation}", processor)


def activation_for(component: Component, processor: Processor) -> Figure:
    """What one activation takes on *processor*; ``EstimateError`` names what is missing."""
    return _scaled(component.activation, f"an activation of {component.name}", processor)


def scale(figure: Figure, frequency_hz: float) -> Figure:
    """The same work at another frequency of the same kind of processor."""
    time_ns = round(figure.time_ns * figure.frequency_hz / frequency_hz)
    return replace(figure, time_ns=time_ns, frequency_hz=frequency_hz)


def _scaled(figures: tuple[Figure, ...], what: str, processor: Processor) -> Figure:
    """The entry stated at the nearest frequency, scaled."""
    if not figures:
        raise EstimateError(
            f"{what}: the model states no time; fidelity `times` needs one at {processor.kind}"
        )
    fitting = [figure for figure in figures if figure.processor == processor.kind]
    if not fitting:
        stated = ", ".join(sorted({figure.processor for figure in figures}))
        raise EstimateError(
            f"{what}: its time is stated at {stated} and cannot be scaled to {processor.kind} "
            f"({processor.name}); add an entry with `at: {{processor: {processor.kind}, frequency: ...}}`"
        )
    nearest = min(fitting, key=lambda figure: abs(figure.frequency_hz - processor.frequency_hz))
    return scale(nearest, processor.frequency_hz)
