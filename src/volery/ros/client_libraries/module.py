"""Modules as users' files import them: what a face does not offer says so when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any, NoReturn

from volery.base.errors import choices, did_you_mean


def face_module(name: str, names: Mapping[str, Any]) -> ModuleType:
    """The module *name* with these *names* in it; ``AttributeError`` for another one lists the valid ones."""
    module = ModuleType(name, f"{name.partition('.')[0]} on the embedded graph.")
    module.__path__ = []
    vars(module).update(names)

    def missing(attribute: str) -> NoReturn:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        hint = did_you_mean(attribute, names)
        raise AttributeError(
            f"{name}.{attribute} is not there on the embedded graph{hint}; there is {choices(names)}"
        )

    vars(module)["__getattr__"] = missing
    return module
