"""Design-space exploration: campaigns of many runs over seeds and variants of a model, and what they show.

``volery.explore(...)`` runs a campaign. The function and this package share a name: the package is callable.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A package that may be called as the function of its name."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Run the campaign of ``campaign.CampaignRequest.of(...)``: see there, and ``campaign.explore``."""
        from volery.explore.campaign import CampaignRequest, explore  # noqa: PLC0415  # light to import

        return explore(CampaignRequest.of(*arguments, **options))


sys.modules[__name__].__class__ = _Callable
