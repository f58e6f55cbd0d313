"""However a model is spoilt: it is read, or refused in words that name the file. Never anything else."""

from pathlib import Path
from shutil import copytree

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from volery.base.errors import ModelError
from volery.model.reading import ProcessorKind, Vocabulary
from volery.model.system import System
from volery.model.system_loader import load
from volery.requirements.observables import OBSERVABLES

STARTER = Path(__file__).parents[2] / "examples" / "starter"
TEXT = (STARTER / "model.yaml").read_text()
WORDS = sorted(set(TEXT.replace(":", " ").replace(",", " ").split()))
VOCABULARY = Vocabulary(
    {"rpi4-cortex-a72": ProcessorKind(4, 0.6e9, 1.5e9)},
    frozenset({"ardupilot"}),
    OBSERVABLES,
)
SPOILING = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture
def folder(tmp_path):
    copytree(STARTER, tmp_path, dirs_exist_ok=True)
    return tmp_path


def read(folder, text):
    """Read or be refused; anything else is a fault."""
    (folder / "model.yaml").write_text(text)
    try:
        return load(folder, VOCABULARY)
    except ModelError as error:
        return str(error)


def check(outcome):
    assert isinstance(outcome, System) or "model.yaml" in outcome, outcome


def test_it_is_right_as_it_is(folder):
    assert isinstance(read(folder, TEXT), System)


@SPOILING
@given(st.data())
def test_a_word_for_another(folder, data):
    old, new = (
        data.draw(st.sampled_from(WORDS)),
        data.draw(st.sampled_from([*WORDS, "", "0", "-1 s", "null", "{}", "[]"])),
    )
    check(read(folder, TEXT.replace(old, new, data.draw(st.integers(1, 3)))))


@SPOILING
@given(st.integers(0, len(TEXT)), st.integers(0, 40), st.text("{}[]:,-#&*!|>'\"% \nabc019_.", max_size=8))
def test_a_stretch_of_text_for_another(folder, start, length, new):
    check(read(folder, TEXT[:start] + new + TEXT[start + length :]))


@SPOILING
@given(st.sets(st.integers(0, len(TEXT.splitlines()) - 1), min_size=1, max_size=6))
def test_lines_that_are_missing(folder, missing):
    lines = [line for number, line in enumerate(TEXT.splitlines()) if number not in missing]
    check(read(folder, "\n".join(lines)))
