"""Models built in Python: the same model as from YAML, the same messages, at the line of the program."""

from pathlib import Path

import pytest

from volery.base.errors import ModelError, UsageError
from volery.model.builder import ModelBuilder
from volery.model.system_loader import load
from volery.model.text import Quoted, parse


def built(folder: Path) -> ModelBuilder:
    model = ModelBuilder("pair", folder=folder)
    model.add("interfaces", "Routing", path={"args": {"start": "Position"}, "returns": "Position[]"})
    model.add(
        "components",
        "Planner",
        language="python",
        path=Path("code") / "planner.py",
        provides={"paths": "Routing"},
        operations={"path": {"time": "1 ms", "at": {"processor": "intel-i5-3470", "frequency": "3 GHz"}}},
        parameters={"label": Quoted("10 m"), "reach": "10 m"},
    )
    model.add("components", "User", language="python", requires={"routes": "Routing"}, active=True)
    model.add("application", "planner", is_="Planner")
    model.add("application", "user", is_="User", routes="planner.paths")
    model.add("platform.processors", "ground", is_="intel-i5-3470", frequency="3 GHz")
    model.add("allocations", "all", planner="ground", user="ground")
    model.set("run.duration", "1 min")
    return model


def test_it_is_the_model_of_its_text(workshop):
    model = built(workshop.folder)
    file = workshop.folder / "pair.yaml"
    model.write(file)
    from_text = load(file, workshop.vocabulary)
    from_python = load(model, workshop.vocabulary)
    assert from_python.instances == from_text.instances
    assert from_python.components == from_text.components
    assert from_python.processors == from_text.processors
    assert from_python.limits == from_text.limits
    assert from_python.components["Planner"].parameters == {"label": "10 m", "reach": 10.0}
    assert parse(from_python.sources[0].text, "text").plain() == parse(file.read_text(), "text").plain()


def test_a_message_names_the_line_of_the_program(workshop):
    model = built(workshop.folder)
    model.add("application", "second", is_="Planer")
    line = next(n for n, text in enumerate(Path(__file__).read_text().splitlines(), 1) if '"Planer")' in text)
    model.set("allocations.all.second", "ground")
    with pytest.raises(ModelError) as caught:
        load(model, workshop.vocabulary)
    assert str(caught.value).startswith(
        f"{__file__}:{line}: application.second.is: no component named 'Planer'"
    )


def test_a_built_model_can_be_loaded_twice_and_with_options(workshop):
    model = built(workshop.folder)
    assert load(model, workshop.vocabulary).processor("ground").frequency_mhz == 3000
    option = "platform.processors.ground.frequency=2 GHz"
    assert load(model, workshop.vocabulary, overrides=[option]).processor("ground").frequency_mhz == 2000
    assert load(model, workshop.vocabulary).processor("ground").frequency_mhz == 3000


def test_an_entry_twice_is_refused_where_it_happens():
    model = ModelBuilder("x")
    model.add("components", "A", language="python")
    with pytest.raises(UsageError, match=r"components has 'A' already, from .*test_builder\.py:\d+"):
        model.add("components", "A", language="rospy")


@pytest.mark.parametrize("value", [object(), {1, 2}, b"x", {"a": object()}])
def test_a_value_that_yaml_cannot_state_is_refused(value):
    with pytest.raises(UsageError, match="is no value of a model"):
        ModelBuilder("x").add("components", "A", parameters={"p": value})


def test_what_is_no_mapping_cannot_have_entries():
    model = ModelBuilder("x")
    model.set("run", "short")
    with pytest.raises(UsageError, match="run is 'short', not a mapping"):
        model.set("run.duration", "1 s")
