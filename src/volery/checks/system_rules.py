"""Rules that need a finished system: load, memory, deadlines, requirements, tool chains."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

from volery.analysis.system_analysis import analyse
from volery.base.errors import EstimateError, Location, UsageError, choices
from volery.base.time import to_seconds
from volery.components.cpp.compiler import COMPILER_HINT, has_compiler
from volery.cost import load_catalogue
from volery.model import rules
from volery.model.components import CPP_LANGUAGES
from volery.model.instances import Instance
from volery.model.rules import BrokenRule
from volery.model.system import ProcessorSpec, RequiredBound, System
from volery.run.assembly.computers import commanded_by, is_node

_SHARES = ("utilisation", "battery_min")

Rule = Callable[[System], Iterator[BrokenRule]]


def instance_path(instance: Instance) -> str:
    """Return the path of an instance in the model."""
    section = "environment.components" if instance.is_environment else "application"
    return f"{section}.{instance.name}"


# -- load, memory, deadlines


def overload(system: System) -> Iterator[BrokenRule]:
    """Find processors whose stated work is more than all their cores can do."""
    try:
        shares = analyse(system).processors
    except (EstimateError, UsageError):  # no figures of a processor, or a name that ROS does not take
        return
    for share in shares:
        if share.share > 1.0:
            processor = system.processor(share.resource)
            cores = f"{share.share:.0%} of its {processor.cores} cores"
            what = f"its components need {cores}, by their longest times"
            at = f"platform.processors.{share.resource}"
            yield BrokenRule(rules.OVERLOAD, what, at, processor.where)


def deadlines(system: System) -> Iterator[BrokenRule]:
    """Find deadlines that are later than the next release."""
    for instance in system.instances:
        activity = instance.activity
        if activity is None or activity.period_ns is None or activity.deadline_ns is None:
            continue
        if activity.deadline_ns > activity.period_ns:
            what = (
                f"the deadline of {to_seconds(activity.deadline_ns):g} s is after the next release, "
                f"{to_seconds(activity.period_ns):g} s after the first"
            )
            yield BrokenRule(rules.DEADLINE_PERIOD, what, instance_path(instance), instance.where)


def memory(system: System) -> Iterator[BrokenRule]:
    """Find memory spaces and processors with less memory than their components take."""
    needed: dict[tuple[str, str], float] = defaultdict(float)
    for instance in system.instances:
        size = instance.component.memory_b or 0.0
        if instance.memory_space is not None:
            needed["memory_spaces", instance.memory_space] += size
        if instance.processor is not None:
            needed["platform.processors", instance.processor] += size
    places: list[tuple[str, str, float | None, Location | None]] = [
        *(("memory_spaces", space.name, space.memory_b, space.where) for space in system.memory_spaces),
        *(
            ("platform.processors", processor.name, processor.memory_b, processor.where)
            for processor in system.processors
        ),
    ]
    for section, name, size_there, where in places:
        taken = needed[section, name]
        if size_there is not None and taken > size_there:
            what = f"its components take {taken / 1e6:g} MB, and it has {size_there / 1e6:g} MB"
            yield BrokenRule(rules.MEMORY_EXCEEDED, what, f"{section}.{name}", where)


# -- requirements


def requirements(system: System) -> Iterator[BrokenRule]:
    """Find requirements that no run can meet, that every run meets, or of which nothing is observed."""
    for bound in system.requirements:
        why = _unobserved(system, bound) or _unreachable(system, bound)
        if why:
            yield BrokenRule(rules.UNREACHABLE, why, f"requirements.{bound.name}", bound.where)


def _unobserved(system: System, bound: RequiredBound) -> str:
    """Return why nothing can be observed of what a bound is about; empty if something can."""
    subject, _, quantity = bound.observe.rpartition(".")
    name, _, operation = subject.partition(".")
    instance = next((instance for instance in system.instances if instance.name == name), None)
    if instance is not None:
        of_calls = operation or quantity.startswith("call")
        return (
            _no_calls(system, instance, quantity) if of_calls else _no_computing(system, instance, quantity)
        )
    if quantity in ("energy", "computing_energy"):
        return _without_power(
            system,
            [processor for processor in system.processors if subject in (processor.name, "application")],
        )
    network = next((network for network in system.networks if network.name == subject), None)
    if network is not None and quantity.startswith("delay"):
        places = {
            *(instance.processor for instance in system.instances),
            *(vehicle.processor for vehicle in system.vehicles),
        }
        used = places & {*network.between}
        if len(used) < 2:
            return f"nothing is sent over {network.name}: fewer than two of its processors execute anything"
    if any(vehicle.name == subject for vehicle in system.vehicles) and quantity in _COMMANDED:
        return _uncommanded(system, subject)
    return ""


_COMMANDED = ("landing_offset", "goto_error", "goto_error_vertical", "goto_error_by_estimate")
"""Quantities of the operations that components command of a vehicle."""


def _no_calls(system: System, instance: Instance, quantity: str) -> str:
    """Return why no call of an instance is observed; calls of ROS services are known when it runs."""
    targets = {
        target.name for instance in system.instances for connection in instance.connections.values()
        for target in connection.targets
    }  # fmt: skip
    if instance.name in targets or is_node(instance) or quantity in ("calls", "failures"):
        return ""
    return f"nothing is connected to {instance.name}: no operation of it is called"


def _no_computing(system: System, instance: Instance, quantity: str) -> str:
    name = instance.name
    if quantity in ("cpu_time", "utilisation", "energy") and instance.processor is None:
        return f"{name} is allocated to no processor: its computing is not counted"
    if quantity == "energy":
        return _without_power(
            system, [processor for processor in system.processors if processor.name == instance.processor]
        )
    if quantity.startswith("response_time") and instance.activity is None:
        return _no_calls(system, instance, quantity)
    if quantity == "deadline_misses" and (instance.activity is None or instance.activity.deadline_ns is None):
        return f"{name} has no deadline: there is nothing to judge"
    if quantity == "period_violations" and (instance.activity is None or instance.activity.period_ns is None):
        return f"{name} has no period: there is nothing to judge"
    return ""


def _without_power(system: System, processors: list[ProcessorSpec]) -> str:
    catalogue = load_catalogue(*system.catalogues).processors
    unknown = [
        f"{processor.name} ({processor.kind})"
        for processor in processors
        if catalogue[processor.kind].power is None
    ]
    return f"nothing is known of the power of {choices(unknown)}: no energy is computed" if unknown else ""


def _uncommanded(system: System, vehicle: str) -> str:
    if any(vehicle in commanded_by(instance) or is_node(instance) for instance in system.instances):
        return ""
    return f"no component commands {vehicle}: it does not fly anywhere"


def _unreachable(system: System, bound: RequiredBound) -> str:
    """Return why a bound is met by no run or by every run; empty if that depends on the run."""
    subject, _, quantity = bound.observe.rpartition(".")
    if bound.relation == "max" and bound.bound < 0.0:
        return f"{bound.observe} is never negative"
    if bound.relation == "min":
        return _unreachable_minimum(system, bound, quantity)
    for instance in system.instances:
        if subject == instance.name:
            return _unreachable_times(system, instance, quantity, bound)
    return ""


def _unreachable_minimum(system: System, bound: RequiredBound, quantity: str) -> str:
    orders = system.environment.workload
    most = orders.count if orders.rate_hz or orders.count else 0
    of_orders = bound.observe in ("application.delivered", "application.ordered")
    if bound.bound <= 0.0:
        return f"{bound.observe} is never less than zero: every run meets it"
    if of_orders and most is not None and bound.bound > most:
        return f"{bound.bound:g} are required, and {most} are ordered"
    if quantity in _SHARES and bound.bound > 1.0:
        return f"{bound.bound:g} is required of a share, which is at most 1"
    for vehicle in system.vehicles:
        left = vehicle.battery.charge if vehicle.battery is not None else 1.0
        if bound.observe == f"{vehicle.name}.battery_min" and bound.bound > left:
            return f"{bound.bound:g} is required, and the battery has {left:g} at the start"
    return ""


def _unreachable_times(system: System, instance: Instance, quantity: str, bound: RequiredBound) -> str:
    if instance.activity is None or not quantity.startswith("response_time") or instance.processor is None:
        return ""
    processor = system.processor(instance.processor)
    for figure in instance.component.activation:
        if figure.processor == processor.kind:
            least = figure.best_ns if figure.best_ns is not None else figure.time_ns
            takes = to_seconds(least) * figure.frequency_hz / processor.frequency_hz
            if takes > bound.bound:
                return f"an activation takes {takes * 1e3:g} ms there, more than {bound.bound * 1e3:g} ms"
    return ""


# -- this machine


def tool_chains(system: System) -> Iterator[BrokenRule]:
    """Find languages whose compiler is not on this machine."""
    for component in {instance.component.name: instance.component for instance in system.instances}.values():
        if component.path and component.language in CPP_LANGUAGES and not has_compiler():
            what = f"no C++ compiler is installed: {COMPILER_HINT}"
            yield BrokenRule(
                rules.NO_TOOL_CHAIN, what, f"components.{component.name}.language", component.where
            )


SYSTEM_RULES: tuple[Rule, ...] = (overload, deadlines, memory, requirements, tool_chains)
"""Every function above, in the order of the report."""
