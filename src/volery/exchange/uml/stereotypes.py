"""The stereotypes that an export applies, and the profiles that define them, by their names and addresses.

Names and addresses are facts to interoperate with; the profiles themselves are not part of volery. They are
those of Papyrus' MARTE (2014 and later) and of S3D's profile, version 60.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

_MARTE = "pathmap://Papyrus_PROFILES/MARTE.profile.uml"


@dataclass(frozen=True)
class Profile:
    """A profile: its namespace, the package that defines it, the file it is in, and its stereotypes."""

    uri: str
    package: str
    location: str
    stereotypes: tuple[str, ...]


def _marte(name: str, profile_id: str, *stereotypes: str) -> Profile:
    uri = f"http://www.eclipse.org/papyrus/{name}/1"
    package = f"http://www.eclipse.org/papyrus/MARTE/1#//{name}"
    return Profile(uri, package, f"{_MARTE}#{profile_id}", stereotypes)


_S3D = "http:///schemas/essyn_Profile/_ldjlEFb0Eeq_WbVqUKzzPg/60"
_UTP = "http://essyn_Profile.UTP_Stereotypes/schemas/UTP/_ldpEoFb0Eeq_WbVqUKzzPg/25"
_STANDARD = "http://www.eclipse.org/uml2/5.0.0/UML/Profile/Standard"

PROFILES: Mapping[str, Profile] = {
    "Standard": Profile(
        _STANDARD, f"{_STANDARD}#/", "pathmap://UML_PROFILES/Standard.profile.uml#_0", ("ModelLibrary",)
    ),
    "NFPs": _marte("NFPs", "_U_GAoAPMEdyuUt-4qHuVvQ", "NfpConstraint"),
    "GRM": _marte("GRM", "_XVWGUAPMEdyuUt-4qHuVvQ", "ResourceUsage"),
    "Alloc": _marte("Alloc", "_ar8OsAPMEdyuUt-4qHuVvQ", "Allocate"),
    "HLAM": _marte("HLAM", "_yNSZIAPMEdyuUt-4qHuVvQ", "RtUnit", "PpUnit", "RtSpecification"),
    "GCM": _marte("GCM", "_YgAioAPMEdyuUt-4qHuVvQ", "FlowPort"),
    "HwComputing": _marte("HwComputing", "_aMhZsBJwEdygQ5HMNSpiZw", "HwProcessor"),
    "HwCommunication": _marte("HwCommunication", "_bmL7UBJwEdygQ5HMNSpiZw", "HwMedia"),
    "HwMemory": _marte("HwMemory", "_gHI-ABJwEdygQ5HMNSpiZw", "HwCache", "HwRAM"),
    "HwDevice": _marte("HwDevice", "_ja8REBJwEdygQ5HMNSpiZw", "HwDevice", "HWSensor", "HWActuator"),
    "SW_Concurrency": _marte("SW_Concurrency", "_A_vtYBJeEdy3Td9UhuLFPg", "MemoryPartition"),
    "SAM": _marte("SAM", "_5ZCOIAPMEdyuUt-4qHuVvQ", "SaEndtoEndFlow"),
    "S3D": Profile(
        _S3D,
        f"{_S3D}#/",
        "pathmap://S3D_profile/essyn.profile.uml#_0IY1UKsIEeGqX9-aQPBm-w",
        (
            "ApplicationView",
            "VerificationView",
            "MemorySpaceView",
            "SWPlatformView",
            "HWResourcesView",
            "ArchitecturalView",
            "System",
            "FilesFolder",
            "OS",
            "ClientServerQueuePort",
            "DseProcessorParameter",
            "DseRule",
            "Pointer",
            "Reference",
        ),
    ),
    "UTP": Profile(
        _UTP, f"{_UTP}#/", "pathmap://S3D_profile/essyn.profile.uml", ("TestContext", "TestComponent")
    ),
}

_PREFIX_OF = {name: prefix for prefix, profile in PROFILES.items() for name in profile.stereotypes}


def prefix_of(stereotype: str) -> str:
    """Return the prefix of the profile that defines a stereotype which an export applies."""
    return _PREFIX_OF[stereotype]


NAMESPACES = {"essyn_Profile" if prefix == "S3D" else prefix: one.uri for prefix, one in PROFILES.items()}
"""Namespaces of the profiles by the prefixes under which Papyrus writes them."""
