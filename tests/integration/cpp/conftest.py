"""Where components in C++ are compiled to, what they are run in, and what their run has left."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rigs.requirements import lacking
from volery.run.result import Options, Run
from volery.run.simulate import simulate
from volery.trace.events import Event
from volery.trace.reader import read

FILES = Path(__file__).parent / "files"


@pytest.fixture(autouse=True)
def compiler(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler is needed; what it makes is kept beside pytest's own cache."""
    if shutil.which("g++") is None:
        lacking("there is no g++ (scripts/debian-packages g++)")
    monkeypatch.setenv("XDG_CACHE_HOME", str(request.config.cache.mkdir("cpp")))


@pytest.fixture
def llvm() -> None:
    """What counts blocks is needed as well."""
    if shutil.which("opt-19") is None:
        lacking("there is no LLVM (scripts/debian-packages native)")


class Outcome:
    """A run that has ended, and the events of its trace."""

    def __init__(self, run: Run) -> None:
        assert run.folder is not None
        self.run = run
        self.trace = read(run.folder / "trace.mcap")

    def of(self, kind: type) -> list[Any]:
        """All events of a kind."""
        return [event for event in self.trace.events if isinstance(event, kind)]

    def events_of(self, component: str) -> list[Event]:
        """All events that a component is named in as their source."""
        return [event for event in self.trace.events if component in (*event,)[:3]]


Simulate = Callable[..., Outcome]


@pytest.fixture
def run_model(tmp_path: Path) -> Simulate:
    """Simulate a model's text, with *files* of this folder and others by their texts beside it."""

    def run(
        model: str,
        *files: str,
        seed: int = 1,
        out: str = "out",
        fidelity: str = "times",
        **texts: str,
    ) -> Outcome:
        for name in files:
            source = FILES / name
            copy = shutil.copytree if source.is_dir() else shutil.copyfile
            if not (tmp_path / name).exists():
                copy(source, tmp_path / name)
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text)
        (tmp_path / "model.yaml").write_text(model)
        return Outcome(simulate(tmp_path, Options(fidelity, seed, out=tmp_path / out)))

    return run
