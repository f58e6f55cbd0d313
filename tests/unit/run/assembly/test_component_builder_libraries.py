"""What a run states about the time that its components spent in libraries."""

from __future__ import annotations

import ast
import re

from volery.cost import StepCounter, library_table
from volery.run.assembly.component_builder import library_warnings


def test_shares_and_what_is_not_counted_are_named() -> None:
    steps = StepCounter(libraries=library_table())
    text = "import numpy as np\nimport json\nx = np.kron(np.eye(9), np.eye(9))\ny = json.dumps([1])\n"
    names = dict(steps.names())
    tree = steps.instrument(ast.parse(text))
    exec(compile(tree, "piece", "exec"), {**names, **steps.names()})
    steps.take()
    unknown, shares, entries = library_warnings(steps, {"numpy", "json", "networkx"})
    assert unknown.endswith("was not counted: networkx; state it with volery.add_time()")
    assert re.search(r"json \d+% \(error 19% on average, 49% at worst over 6 programs\)", shares)
    assert "numpy " in shares
    assert entries == "calls without an entry of their own in that table: numpy.kron (1)"


def test_each_library_has_the_error_of_its_own_programs() -> None:
    steps = StepCounter(libraries=library_table())
    text = "from volery.autonomy.planar_pose import Pose2\npose = Pose2().after(Pose2())\n"
    tree = steps.instrument(ast.parse(text))
    exec(compile(tree, "piece", "exec"), dict(steps.names()))
    steps.take()
    (shares,) = library_warnings(steps, set())
    error = library_table().errors["autonomy"]
    words = f"error {error.mean:.0%} on average, {error.worst:.0%} at worst over {error.programs} programs"
    assert re.fullmatch(rf".*: autonomy \d+% \({words}\)", shares)


def test_nothing_is_said_where_no_library_was_used() -> None:
    assert library_warnings(StepCounter(libraries=library_table()), set()) == []
