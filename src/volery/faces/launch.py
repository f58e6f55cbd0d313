"""What a launch file says of a node, for every face."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Launch(NamedTuple):
    """A node's namespace, its remappings and its private parameters."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}
