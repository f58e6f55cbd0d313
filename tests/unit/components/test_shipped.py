"""The examples that come with the package."""

from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.components import shipped


def test_examples_are_found_in_the_repository():
    assert (shipped.example("delivery") / "model.yaml").is_file()
    assert shipped.example("mission.py").is_file()


def test_once_installed_they_are_beside_the_package(monkeypatch, tmp_path):
    (tmp_path / "examples" / "delivery").mkdir(parents=True)
    monkeypatch.setattr(shipped, "_PACKAGE", tmp_path)
    assert shipped.example("delivery") == tmp_path / "examples" / "delivery"


def test_an_unknown_example_lists_the_others():
    with pytest.raises(UsageError, match=r"no example 'deliver' \(did you mean 'delivery'\?\)"):
        shipped.example("deliver")


def test_an_installation_without_examples_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(shipped, "_PACKAGE", tmp_path / "package")
    monkeypatch.setattr(shipped, "_REPOSITORY", tmp_path)
    with pytest.raises(UsageError, match="missing from this installation"):
        shipped.examples()
