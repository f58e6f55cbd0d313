"""SysML v2 of volery, read by a parser that is not volery's: sysmlpy, which passes the OMG's own tests."""

import importlib
import warnings

import pytest

from rigs.requirements import lacking
from volery.cli.commands.first_steps import example
from volery.exchange.sysml import sysml_text
from volery.model.assembly import read_tree

pytestmark = pytest.mark.integration


def test_an_independent_parser_finds_every_part():
    try:
        sysmlpy = importlib.import_module("sysmlpy")
    except ModuleNotFoundError:
        lacking("sysmlpy is not installed: pip install --group clients")
    text, _ = sysml_text(read_tree(example("delivery") / "model.yaml").plain())
    with warnings.catch_warnings(action="ignore"):  # it cannot keep its cache
        printed = sysmlpy.loads(text).dump()
    for word in ("connect ", "requirement ", "part def "):
        assert printed.count(word) == text.count(word), word
    assert printed.count("allocation ") == text.count("  allocate ")
