"""Why a system cannot work, as far as its model makes that certain without a run.

These are bounds from below, the opposite of those of ``volery.analysis.system_analysis``: a processor
executes at least the stated activations that have a period, and an activation takes at least its own time on
a core of its own, both by their shortest times. What the model leaves open counts nothing. Networks are not
examined: a model states the greatest size of a message, not the least.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from volery.analysis.budgets import memory
from volery.base.errors import EstimateError
from volery.base.time import MS, Ns, to_seconds
from volery.cost import ProcessorPrices, StatedCost, load_catalogue
from volery.model.components import StatedFigure
from volery.model.instances import Instance
from volery.model.system import System


def why_impossible(system: System, fidelity: str) -> Iterator[str]:
    """Yield the reasons why *system* cannot work; none if it may.

    * A processor has more to execute than its cores can.
    * A requirement on ``response_time``, or that there are no ``deadline_misses``, of an activation that
      takes longer by itself. One without a period, which is released on demand, is judged as if that
      happened: otherwise the requirement would be met because the component is never used.
    * A processor has less memory than is stated for its processes.

    Args:
        system: The system.
        fidelity: That of its runs: in ``code``, what is stated of a component that has code counts nothing.

    Raises:
        EstimateError: The catalogue lacks a processor of the system.
    """
    least = _Least(system, fidelity)
    yield from _overloaded(system, least)
    yield from _late(system, least)
    for one in memory(system):
        limit = next((each.memory_b for each in system.processors if each.name == one.processor), None)
        if one.bytes is not None and limit is not None and one.bytes > limit:
            yield f"{one.processor} has less memory than {one.process} needs"


def _overloaded(system: System, least: _Least) -> Iterator[str]:
    for processor in system.processors:
        share = sum(
            least.stated(instance) / instance.activity.period_ns
            for instance in system.instances
            if instance.processor == processor.name
            and instance.activity is not None
            and instance.activity.period_ns
        )
        if share > processor.cores:
            yield f"{processor.name} has more to execute than it can"


def _late(system: System, least: _Least) -> Iterator[str]:
    instances = {
        instance.name: instance
        for instance in system.instances
        if instance.processor is not None and instance.activity
    }
    for one in system.requirements:
        subject, _, quantity = one.observe.rpartition(".")
        instance = instances.get(subject)
        if instance is None or instance.activity is None or one.relation != "max":
            continue
        time, deadline = least.stated(instance) + least.beside(instance), instance.activity.deadline_ns
        late = quantity == "deadline_misses" and one.bound < 1 and deadline is not None and time > deadline
        if late or (quantity == "response_time" and to_seconds(time) > one.bound):
            least_time = f"{subject} takes {time / MS:.1f} ms at least on {instance.processor}"
            yield f"{least_time}: {one.name} cannot be met"


class _Least:
    """Shortest times of activations on the processors of a system, ns; 0 where the model is not certain."""

    def __init__(self, system: System, fidelity: str) -> None:
        self._only_stated = fidelity == "times"
        catalogue = load_catalogue(*system.catalogues)
        self._prices = {
            processor.name: ProcessorPrices(
                processor.name, catalogue.processor(processor.kind), processor.frequency_hz
            )
            for processor in system.processors
        }

    def stated(self, instance: Instance) -> Ns:
        """Return what each activation executes."""
        if not self._only_stated and (instance.component.path or instance.component.package):
            return 0
        return self._scaled(instance, instance.component.activation)

    def beside(self, instance: Instance) -> Ns:
        """Return what an activation that does its work executes beside, if the model says how little."""
        return self._scaled(
            instance, [one for one in instance.component.assume.beside if one.best_ns is not None]
        )

    def _scaled(self, instance: Instance, figures: Sequence[StatedFigure]) -> Ns:
        stated = [
            StatedCost(
                figure.processor,
                figure.frequency_hz,
                figure.time_ns if figure.best_ns is None else figure.best_ns,
            )
            for figure in figures
        ]
        try:
            prices = self._prices[instance.processor or ""].stated(instance.name, {}, stated)
            return prices.activation(instance.name).time
        except EstimateError:  # nothing is stated for this kind of processor
            return 0
