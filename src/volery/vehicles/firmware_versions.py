"""Versions of firmware, and rules whose meaning depends on them.

Autopilots change the meaning of what they send from one version to the next. What a driver reads by version
stands in ``drivers/px4/versions.py`` and ``drivers/ardupilot/versions.py``, with the versions and the source
of each rule. The version is what the vehicle itself states in AUTOPILOT_VERSION.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

MinorVersion = tuple[int, int]
"""Major and minor number."""

_KINDS = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc", 255: ""}
"""FIRMWARE_VERSION_TYPE, by its lowest value."""


class FirmwareVersion(NamedTuple):
    """The version of a firmware; ``kind`` is its FIRMWARE_VERSION_TYPE: 255 for a release."""

    major: int
    minor: int
    patch: int
    kind: int = 255

    @property
    def series(self) -> MinorVersion:
        """Major and minor number."""
        return self.major, self.minor

    def __str__(self) -> str:
        kind = _KINDS.get(self.kind, _KINDS[255])
        return f"{self.major}.{self.minor}.{self.patch}{kind}"


def stated_version(flight_sw_version: int) -> FirmwareVersion | None:
    """Return the version in AUTOPILOT_VERSION; ``None`` if it states none.

    Args:
        flight_sw_version: one byte each for major, minor, patch and kind of release, the major highest.
    """
    if not flight_sw_version:
        return None
    number = flight_sw_version.to_bytes(4, "big")
    return FirmwareVersion(number[0], number[1], number[2], number[3])


@dataclass(frozen=True)
class Meaning(Generic[T]):
    """What something means from one version on.

    Args:
        since: first version with this meaning.
        value: the meaning.
        source: where the firmware says so.
    """

    since: MinorVersion
    value: T
    source: str


class VersionRule(Generic[T]):
    """Something whose meaning depends on the version.

    Args:
        what: what is read.
        meanings: its meanings, the oldest first.
    """

    def __init__(self, what: str, *meanings: Meaning[T]) -> None:
        self.what = what
        self.meanings: Sequence[Meaning[T]] = meanings

    def by(self, version: FirmwareVersion | None) -> T:
        """Return the meaning for a version: the newest one if none covers it, or if it is not known."""
        if version is not None:
            for meaning in reversed(self.meanings):
                if version.series >= meaning.since:
                    return meaning.value
        return self.meanings[-1].value


class Coverage(NamedTuple):
    """The versions, oldest and newest, whose sources the rules of a driver were read from."""

    name: str
    oldest: MinorVersion
    newest: MinorVersion

    def uncovered(self, version: FirmwareVersion) -> str:
        """Return that no rule covers a version, in words; empty if the rules do."""
        if self.oldest <= version.series <= self.newest:
            return ""
        oldest, newest = (".".join(map(str, one)) for one in (self.oldest, self.newest))
        return (
            f"{self.name} {version} is not covered by this driver, which knows {oldest} to {newest}: "
            f"it is flown by the rules of {newest}; try it on the ground first"
        )
