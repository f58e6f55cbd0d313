"""Requirements: bounds on published observables, in their unit."""

from __future__ import annotations

from volery.base import units
from volery.base.units import Kind, NotAQuantity
from volery.model.context import Context
from volery.model.form import BoundForm
from volery.model.problems import Path
from volery.model.system import Bound, Chain, Observable, RunLimits

APPLICATION = "application"


def requirements(context: Context) -> tuple[Bound, ...]:
    """The model's requirements."""
    found = (
        bound(context, ("requirements", name), name, form) for name, form in context.form.requirements.items()
    )
    return tuple(requirement for requirement in found if requirement is not None)


def chains(context: Context) -> tuple[Chain, ...]:
    """The model's chains of topics."""
    for name, topics in context.form.chains.items():
        for place, topic in enumerate(topics):
            if not topic.startswith("/"):
                context.problems.add(
                    ("chains", name, place), f"{topic!r}: write a topic's full name, such as '/{topic}'"
                )
    return tuple(Chain(name, tuple(topics)) for name, topics in context.form.chains.items())


def limits(context: Context) -> RunLimits:
    """How long to run."""
    form = context.form.run
    until = bound(context, ("run", "until"), "until", form.until) if form.until else None
    return RunLimits(form.duration, until)


def bound(context: Context, path: Path, name: str, form: BoundForm) -> Bound | None:
    """One bound; ``None``, with the problem noted, if it makes no sense."""
    observable = _observable(context, (*path, "observe"), form.observe)
    said = [
        (relation, value) for relation, value in (("max", form.max), ("min", form.min)) if value is not None
    ]
    if len(said) != 1:
        context.problems.add(path, "give exactly one of max and min")
        return None
    if observable is None:
        return None
    relation, value = said[0]
    try:
        number = units.read(value, _kind(observable))
    except NotAQuantity as error:
        context.problems.add((*path, relation), f"{form.observe} is {_measured(observable)}: {error}")
        return None
    where = context.where(path)
    return Bound(name, form.observe, relation, number, observable.unit, form.description, where)


def _kind(observable: Observable) -> Kind:
    unit = observable.unit
    return Kind("bound", unit or "1", f"0.5 {unit}" if unit else "3")


def _measured(observable: Observable) -> str:
    return f"measured in {observable.unit}" if observable.unit else "a plain number"


def _observable(context: Context, path: Path, text: str) -> Observable | None:
    subject, _, quantity = text.rpartition(".")
    kinds = subjects(context)
    if not context.known(path, subject, "subject to observe", kinds):
        return None
    offered = {
        observable.quantity: observable
        for observable in context.vocabulary.observables
        if observable.subject == kinds[subject]
    }
    if not context.known(path, quantity, f"quantity of a {kinds[subject]}", offered):
        return None
    return offered[quantity]


def subjects(context: Context) -> dict[str, str]:
    """Whatever may be observed, by name, with the kind of thing it is."""
    form = context.form
    return {
        APPLICATION: "application",
        **dict.fromkeys(form.application, "component"),
        **dict.fromkeys(form.environment.components, "component"),
        **dict.fromkeys(form.platform.processors, "processor"),
        **dict.fromkeys(form.environment.vehicles, "vehicle"),
        **dict.fromkeys(form.chains, "chain"),
    }
