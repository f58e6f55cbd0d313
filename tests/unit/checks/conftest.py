"""A model in which nothing is wrong; tests spoil one thing at a time."""

from pathlib import Path

import pytest

from rigs.watch_model import write_watch_model
from volery.checks.findings import CheckedModel, check
from volery.run.assembly.model_checks import vocabulary


class Bench:
    """A folder with the model, which a test changes and checks."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "model"
        self.file = write_watch_model(self.folder)

    def change(self, old: str, new: str, name: str = "model.yaml") -> None:
        """Replace *old*, which must be there, in a file."""
        file = self.folder / name
        text = file.read_text()
        assert old in text, old
        file.write_text(text.replace(old, new, 1))

    def check(self) -> CheckedModel:
        """The outcome of a check."""
        return check(self.file, vocabulary())

    def line_of(self, text: str, name: str = "model.yaml") -> int:
        """The line of a file that has *text*."""
        lines = (self.folder / name).read_text().splitlines()
        return next(number for number, line in enumerate(lines, 1) if text in line)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)
