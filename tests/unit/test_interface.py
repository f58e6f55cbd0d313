"""The names at the top level of the package."""

from __future__ import annotations

import inspect

import volery
from volery.base import errors


def test_every_error_is_at_the_top_level() -> None:
    for name, kind in inspect.getmembers(errors, inspect.isclass):
        if issubclass(kind, errors.VoleryError):
            assert getattr(volery, name) is kind


def test_star_imports_the_public_names() -> None:
    names: dict[str, object] = {}
    exec("from volery import *", names)
    assert set(volery.__all__) <= names.keys()
    assert "Drone" in volery.__all__
