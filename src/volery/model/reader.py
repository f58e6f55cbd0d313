"""What a valid model still lacks for one fidelity: figures, code, languages that do not run yet.

From a file to a checked ``System``: the door of this room.

``load`` gives one allocation and one scenario; ``check`` tries them all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from volery.base.errors import ModelError, choices
from volery.model.assembly import Assembly, Selection, assemble, change_from_option
from volery.model.document import ModelForm, validate
from volery.model.resolution import (
    Context,
    Surroundings,
    catalogues,
    chains,
    check_all_variants,
    check_names,
    check_reach,
    components,
    environment,
    instances,
    interfaces,
    limits,
    networks,
    places,
    processors,
    requirements,
    with_catalogues,
)
from volery.model.system import Component, Figure, Instance, Interface, System, Vocabulary
from volery.model.text import CollectedModelError, Problems

FIDELITIES = ("times", "code", "firmware", "hardware")
"""Constant times · real component code · real autopilot firmware in the loop · real vehicles."""


def check_ready(system: System, fidelity: str, vocabulary: Vocabulary) -> None:
    """Raise ``ModelError`` for whatever *system* lacks to run at *fidelity* (``times`` or ``code``)."""
    found = list(gaps(system, fidelity, vocabulary))
    if len(found) == 1:
        raise found[0]
    if found:
        raise CollectedModelError(found)


def gaps(system: System, fidelity: str, vocabulary: Vocabulary) -> Iterator[ModelError]:
    """What is missing, component by component, in the order of the model."""
    for component in _used(system):
        if fidelity == "code" and not component.path:
            what = "it has no code: fidelity `code` needs a `path`; `times` runs without"
            yield ModelError(what, f"components.{component.name}", component.where)
        if component.path and component.language not in vocabulary.languages:
            what = f"{component.language} components do not run yet; {choices(vocabulary.languages)} do"
            yield ModelError(what, f"components.{component.name}.language", component.where)
    if fidelity == "times":
        for instance in system.instances:
            yield from _missing_figures(system, instance)


def _used(system: System) -> list[Component]:
    """The components that have instances."""
    return list({instance.component.name: instance.component for instance in system.instances}.values())


def _missing_figures(system: System, instance: Instance) -> Iterator[ModelError]:
    if instance.processor is None:
        return
    kind = system.processor(instance.processor).kind
    component = instance.component
    for operation in _offered(component, dict(system.interfaces)):
        figures = component.operations.get(operation, ())
        yield from _missing(instance, f"operations.{operation}", figures, kind)
    if instance.activity is not None:
        yield from _missing(instance, "activation", component.activation, kind)


def _offered(component: Component, interfaces: dict[str, Interface]) -> list[str]:
    return [
        operation
        for interface in component.provides.values()
        for operation in interfaces[interface].operations
    ]


def _missing(instance: Instance, what: str, figures: tuple[Figure, ...], kind: str) -> Iterator[ModelError]:
    if any(figure.processor == kind for figure in figures):
        return
    stated = f" (there is one at {choices({figure.processor for figure in figures})})" if figures else ""
    yield ModelError(
        f"no time is stated at {kind}, where {instance.name} runs{stated}; fidelity `times` needs one",
        f"components.{instance.component.name}.{what}",
        instance.component.where,
    )


DEFAULT_FILE = "model.yaml"
"""What a folder stands for."""


def load(
    path: str | Path,
    vocabulary: Vocabulary,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> System:
    """Read the model at *path* (a file, or a folder with a ``model.yaml``).

    *scenario* ``None``: as the model stands; *allocation* ``None``: the scenario's, or the first of the
    model. *overrides* are texts ``path=value`` and win over both. Raises ``ModelError`` for what is wrong
    with the model, all of it at once (``CollectedModelError``), and ``UsageError`` for a scenario or an
    allocation it does not have.
    """
    options = tuple(overrides)
    wanted = Selection(scenario, allocation, tuple(change_from_option(text) for text in options))
    file = _file(Path(path))
    made, problems = assemble(file, wanted)
    form = validate(ModelForm, made.root, problems)
    problems.raise_if_any()
    assert form is not None, "a form that does not validate is a problem"
    context = Context(form, vocabulary, problems, file.parent)
    return _resolve(with_catalogues(context), made, options)


def check(path: str | Path, vocabulary: Vocabulary, overrides: Iterable[str] = ()) -> System:
    """Read the model with each of its allocations and each of its scenarios; return it as it stands.

    It has the warnings of all of them. Raises what ``load`` raises, for all of them together.
    """
    options = tuple(overrides)
    system = load(path, vocabulary, overrides=options)
    found: dict[str, ModelError] = {}
    warnings = dict.fromkeys(system.warnings)
    variants = [(None, name) for name in system.allocations] + [(name, None) for name in system.scenarios]
    for scenario, allocation in variants:
        try:
            variant = load(path, vocabulary, scenario, allocation, options)
            warnings.update(dict.fromkeys(variant.warnings))
        except CollectedModelError as several:
            found |= {str(error): error for error in several.errors}
        except ModelError as error:
            found[str(error)] = error
    if len(found) == 1:
        raise next(iter(found.values()))
    if found:
        raise CollectedModelError(found.values())
    return replace(system, warnings=tuple(warnings))


def _file(path: Path) -> Path:
    return path / DEFAULT_FILE if path.is_dir() else path


def _resolve(context: Context, made: Assembly, options: tuple[str, ...]) -> System:
    problems: Problems = context.problems
    check_names(context)
    check_all_variants(context)
    where = places(context, made.allocation, made.places)
    known = interfaces(context)
    library = components(context, known)
    system = System(
        name=context.form.name,
        instances=instances(Surroundings(context, known, library), where),
        processors=processors(context),
        networks=networks(context),
        environment=environment(context, where),
        chains=chains(context),
        requirements=requirements(context),
        limits=limits(context),
        components=library,
        interfaces=known,
        description=context.form.description,
        allocation=made.allocation,
        scenario=made.scenario,
        allocations=tuple(context.form.allocations),
        scenarios=tuple(context.form.scenarios),
        overrides=options,
        sources=made.sources,
        folder=context.folder,
        catalogues=catalogues(context),
    )
    check_reach(context, system.instances, system.networks)
    problems.raise_if_any()
    return replace(system, warnings=problems.warnings)
