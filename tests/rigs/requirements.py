"""What a test needs and this machine has not: the test is skipped, or fails where everything is required."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NoReturn

import pytest


def lacking(what: str) -> NoReturn:
    """Skip for want of *what*; with ``VOLERY_REQUIRE_ALL=1``, as in CI, fail."""
    if os.environ.get("VOLERY_REQUIRE_ALL") == "1":
        pytest.fail(f"{what}, and VOLERY_REQUIRE_ALL=1 asks for it")
    pytest.skip(what)


def firmware_program(variable: str) -> Path:
    """Return the program of real firmware that an environment variable names, else skip.

    Nobody distributes these programs and their builds take long, so that CI has none either.
    """
    stated = os.environ.get(variable)
    if not stated:
        pytest.skip(f"{variable} names no program of real firmware")
    return Path(stated)
