"""Packages of interfaces as modules, so that a file may say ``from std_msgs.msg import String``."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

from volery.base.errors import choices, did_you_mean
from volery.ros.messages.store import action_types, message_class, service, service_types, types

ROS1_SPELLING = {"mavros_msgs": {"VFR_HUD": "VfrHud"}}
"""Types that ROS 1 spells otherwise: by package, its name and ours."""


class _Definitions(ModuleType):
    """``package.msg``, ``package.srv`` or ``package.action``; a class is made when it is first asked for."""

    def __init__(self, package: str, kind: str, names: list[str]) -> None:
        super().__init__(f"{package}.{kind}", f"The {kind} types of {package}.")
        self._package, self._kind = package, kind
        self._known = names
        self.__all__ = names

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        wanted = ROS1_SPELLING.get(self._package, {}).get(name, name)
        for ending in ("Request", "Response"):
            if self._kind == "srv" and wanted.endswith(ending) and wanted not in self._known:
                pair = getattr(self, wanted.removesuffix(ending).removesuffix("_"))
                return getattr(pair, ending)
        if wanted not in self._known:
            hint = did_you_mean(name, self._known)
            raise AttributeError(f"{self.__name__} has no {name!r}{hint}; it has {choices(self._known)}")
        full = f"{self._package}/{self._kind}/{wanted}"
        made = _MAKERS[self._kind](full)
        setattr(self, name, made)
        return made


def service_class(full: str) -> type:
    """What ``from package.srv import Name`` gives: a class that carries ``Request`` and ``Response``."""
    pair = service(full)
    members = {
        "_type": full,
        "_request_class": pair.request,
        "_response_class": pair.response,
        "Request": pair.request,
        "Response": pair.response,
    }
    return type(full.rpartition("/")[2], (), members)


def _action_class(full: str) -> type:
    """What ``from package.action import Name`` gives."""
    inner = full.replace("/action/", "/msg/")
    members = {
        "_type": full,
        **{part: message_class(f"{inner}_{part}") for part in ("Goal", "Result", "Feedback")},
        "SendGoal": service_class(f"{full}_SendGoal"),
        "GetResult": service_class(f"{full}_GetResult"),
        "FeedbackMessage": message_class(f"{full}_FeedbackMessage"),
    }
    return type(full.rpartition("/")[2], (), members)


_MAKERS: dict[str, Callable[[str], type]] = {
    "msg": message_class,
    "srv": service_class,
    "action": _action_class,
}


def modules() -> dict[str, ModuleType]:
    """All packages: ``std_msgs``, ``std_msgs.msg``, ``std_srvs.srv`` and so on, by the name of the import."""
    found: dict[str, ModuleType] = {}
    for kind, names in (("msg", types()), ("srv", service_types()), ("action", action_types())):
        by_package: dict[str, list[str]] = {}
        for full in names:
            by_package.setdefault(full.split("/")[0], []).append(full.split("/")[-1])
        for package, listed in by_package.items():
            parent = found.setdefault(package, ModuleType(package))
            parent.__path__ = []
            inner = _Definitions(package, kind, listed)
            setattr(parent, kind, inner)
            found[f"{package}.{kind}"] = inner
    return found
