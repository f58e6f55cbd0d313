"""Files in and out: formats by their endings, what is refused, and what is kept on disk."""

import re

import pytest

from rigs.watch_model import write_watch_model
from volery.base.errors import ModelError, UsageError
from volery.exchange.convert import export_model, import_model, read_uml
from volery.exchange.xml_text import MOST_BYTES
from volery.model.assembly import read_tree
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

WORDS = vocabulary()
CATALOGUE = tuple(WORDS.processors)


@pytest.fixture
def watch(tmp_path):
    return write_watch_model(tmp_path / "watch")


def test_a_model_is_the_same_after_uml_in_another_folder(watch, tmp_path):
    uml, back = tmp_path / "uml" / "watch.uml", watch.parent / "back.yaml"
    uml.parent.mkdir()
    assert export_model(watch, uml, WORDS) == ()
    assert "$path=../watch/code/camera.py;" in uml.read_text()
    import_model(uml, back, CATALOGUE)
    assert read_tree(back).plain() == read_tree(watch).plain()
    one, other = load(watch, WORDS), load(back, WORDS)
    assert (one.instances, one.processors, one.networks) == (
        other.instances,
        other.processors,
        other.networks,
    )
    assert (one.requirements, one.components, one.environment) == (
        other.requirements,
        other.components,
        other.environment,
    )


def test_an_export_into_a_file_that_is_there_keeps_its_ids(watch, tmp_path):
    uml = tmp_path / "watch.uml"
    export_model(watch, uml, WORDS)
    before = re.findall(r'xmi:id="([^"]+)"', uml.read_text())
    text = uml.read_text().replace('name="lens"', 'name="lens" visibility="private"')
    uml.write_text(text)
    watch.write_text(watch.read_text().replace("priority: 7", "priority: 9"))
    export_model(watch, uml, WORDS)
    assert re.findall(r'xmi:id="([^"]+)"', uml.read_text()) == before
    assert 'visibility="private"' in uml.read_text()
    assert 'priority="9"' in uml.read_text()


def test_a_model_that_is_there_is_not_written_over(watch, tmp_path):
    uml = tmp_path / "watch.uml"
    export_model(watch, uml, WORDS)
    with pytest.raises(UsageError, match="exists; --replace writes over it"):
        import_model(uml, watch, CATALOGUE)
    import_model(uml, watch, CATALOGUE, replace=True)


@pytest.mark.parametrize("ending", [".di", ".notation"])
def test_a_file_of_diagrams_is_refused_with_the_file_that_is_meant(tmp_path, ending):
    file = tmp_path / f"system{ending}"
    file.write_text("<x/>")
    with pytest.raises(ModelError, match=r"no model in it; give system\.uml beside it"):
        read_uml(file, tmp_path, CATALOGUE)


def test_a_file_of_50_mb_is_refused_before_it_is_read(tmp_path):
    file = tmp_path / "large.uml"
    with file.open("wb") as out:
        out.truncate(50_000_000)
    with pytest.raises(ModelError, match=f"larger than {MOST_BYTES} bytes"):
        read_uml(file, tmp_path, CATALOGUE)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(ModelError, match="No such file"):
        read_uml(tmp_path / "none.uml", tmp_path, CATALOGUE)
    with pytest.raises(ModelError, match="Is a directory"):
        read_uml(tmp_path, tmp_path, CATALOGUE)


def test_the_ending_chooses_the_format(watch, tmp_path):
    with pytest.raises(UsageError, match=r"its ending chooses the format: \.aadl \(AADL\), \.launch"):
        export_model(watch, tmp_path / "x.xmi", WORDS)
    with pytest.raises(UsageError, match="cannot write"):
        export_model(watch, tmp_path / "none" / "x.sysml", WORDS)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("latency: 15 ms", "latency: 15 msec", r"model\.yaml:\d+: .*there is no unit 'msec'"),
        ("components:\n", "components: 5\nother:\n", "a mapping of keys is expected, not 5"),
        ("requires: {eyes: Grab}", "requires: [eyes]", "a mapping of keys is expected, not a list"),
    ],
)
@pytest.mark.parametrize("ending", [".uml", ".aadl", ".sysml"])
def test_a_text_that_is_no_model_is_not_exported(watch, tmp_path, old, new, expected, ending):
    watch.write_text(watch.read_text().replace(old, new, 1))
    with pytest.raises(ModelError, match=expected):
        export_model(watch, tmp_path / f"x{ending}", WORDS)
    assert not (tmp_path / f"x{ending}").exists()


def test_a_model_that_is_not_complete_is_exported(watch, tmp_path):
    watch.write_text(watch.read_text().replace("code/pilot.py", "code/later.py").replace(", map: ground", ""))
    assert export_model(watch, tmp_path / "x.uml", WORDS) == ()
