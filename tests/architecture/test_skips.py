"""No test hides what is missing: whoever needs a program says so by ``lacking``, which fails in CI."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rigs.requirements import lacking

TESTS = Path(__file__).parents[1]
SKIPS = re.compile(r"pytest\.(?:skip\(|importorskip\(|mark\.skip|mark\.xfail|xfail\()")

OF_THE_SYSTEM = {"unit/trace/test_timeline.py", "architecture/test_committed_texts.py"}
"""Where no package would help: a system without /dev/full, a copy that is no clone."""


def test_a_test_skips_only_for_want_of_what_ci_must_have():
    skipping = {
        path.relative_to(TESTS).as_posix()
        for path in TESTS.rglob("*.py")
        if SKIPS.search(path.read_text()) and path != Path(__file__)
    }
    assert skipping == OF_THE_SYSTEM | {"rigs/requirements.py"}


def test_what_is_missing_skips_and_where_all_is_required_fails(monkeypatch):
    monkeypatch.delenv("VOLERY_REQUIRE_ALL", raising=False)
    with pytest.raises(pytest.skip.Exception, match="no server"):
        lacking("no server")
    monkeypatch.setenv("VOLERY_REQUIRE_ALL", "1")
    with pytest.raises(pytest.fail.Exception, match="no server, and VOLERY_REQUIRE_ALL=1"):
        lacking("no server")
