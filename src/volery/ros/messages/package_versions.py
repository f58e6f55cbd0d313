"""Packages that are defined otherwise in older versions of what they belong to: ``px4_msgs``.

``definitions/`` has the newest version. Each file of ``older_definitions/`` has the types that its version
defines otherwise than the next one, so that a version is the newest with all later files applied backwards.
"""

from __future__ import annotations

from importlib.resources import files

from volery.base.errors import UsageError, choices, did_you_mean
from volery.ros.messages.store import define_all, has_messages, is_known_as, read_definitions, replace_known

NEWEST = {"px4_msgs": "1.17"}
"""Version of ``definitions/`` by package."""
_OLDER = {"px4_msgs": ("1.16", "1.15", "1.14")}
"""Older versions by package, the newest of them first."""


def versions_of(package: str) -> tuple[str, ...]:
    """Return the versions of a package, the newest first; none of a package that has only one."""
    return (NEWEST[package], *_OLDER[package]) if package in NEWEST else ()


_in_use: dict[str, str] = {}
"""Version of a package in this process, where it is not the newest."""


def use_version(package: str, version: str) -> None:
    """Define the types of *package* as *version* does, in this process from now on.

    Definitions of a workspace that is read later win over these.

    Raises:
        UsageError: There is no such version, or messages of another one exist already.
    """
    known = versions_of(package)
    if version not in known:
        hint = did_you_mean(version, known)
        raise UsageError(f"{package} has no version {version!r}{hint}; there is {choices(known)}")
    present = _in_use.get(package, known[0])
    if version == present:
        return
    texts = _read(package, f"definitions/{package}.txt")
    for older in known[1 : known.index(version) + 1]:
        texts.update(_read(package, f"older_definitions/{package}-{older}.txt"))
    other = {name: text for name, text in texts.items() if not is_known_as(name, text)}
    if any(has_messages(name) for name in other):
        raise UsageError(
            f"{package} of {version}: this process has messages of {present} already; start another process"
        )
    define_all({name: text for name, text in other.items() if replace_known(name, text)})
    _in_use[package] = version


def _read(package: str, file: str) -> dict[str, str]:
    text = files("volery.ros.messages").joinpath(file).read_text(encoding="utf-8")
    return read_definitions(package, text)
