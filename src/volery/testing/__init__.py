"""Conformance suites, fault trials and fuzzing, for this project and for authors of drivers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.testing.driver_conformance import Outcome, Report, Result, conformance

__all__ = ["Outcome", "Report", "Result", "conformance"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'volery.testing' has no attribute {name!r}")
    return getattr(import_module("volery.testing.driver_conformance"), name)
