"""What a test needs and this machine has not: the test is skipped, or fails where everything is required."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest


def lacking(what: str) -> NoReturn:
    """Skip for want of *what*; with ``VOLERY_REQUIRE_ALL=1``, as in CI, fail."""
    if os.environ.get("VOLERY_REQUIRE_ALL") == "1":
        pytest.fail(f"{what}, and VOLERY_REQUIRE_ALL=1 asks for it")
    pytest.skip(what)
