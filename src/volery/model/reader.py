"""From a file to a checked ``System``: the door of this room.

``load`` gives one allocation and one scenario; ``check`` tries them all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from volery.base.errors import ModelError
from volery.model import changes
from volery.model.assembly import Assembly, Wanted, assemble
from volery.model.context import Context
from volery.model.form import ModelForm
from volery.model.problems import CollectedModelError, Problems
from volery.model.resolve_application import Surroundings, instances
from volery.model.resolve_environment import environment
from volery.model.resolve_library import components, interfaces
from volery.model.resolve_platform import (
    catalogues,
    check_all_variants,
    check_names,
    check_reach,
    networks,
    places,
    processors,
    with_catalogues,
)
from volery.model.resolve_requirements import chains, limits, requirements
from volery.model.system import System, Vocabulary
from volery.model.validation import validate

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
    wanted = Wanted(scenario, allocation, tuple(changes.from_option(text) for text in options))
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
