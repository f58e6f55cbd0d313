"""What a valid model lacks for a fidelity."""

import pytest

from volery.base.errors import ModelError
from volery.model.system_loader import check_ready, gaps


def test_times_needs_a_figure_at_each_kind_of_processor(workshop):
    found = [str(gap) for gap in gaps(workshop.load(), "times", workshop.vocabulary)]
    assert len(found) == 2  # control's operation and its activation
    assert "components.drone_control.operations.deliver: no time is stated at rpi4-cortex-a72" in found[0]
    assert "components.drone_control.activation" in found[1]


def test_a_figure_at_another_processor_is_named(workshop):
    system = workshop.load(None, None, "allocations.fast.central=onboard")
    found = [str(gap) for gap in gaps(system, "times", workshop.vocabulary)]
    assert "where central runs (there is one at intel-i5-3470); fidelity `times` needs one" in found[0]


def test_code_needs_files(workshop):
    check_ready(workshop.load(), "code", workshop.vocabulary)
    workshop.change("    path: code/planner.py\n", "")
    with pytest.raises(
        ModelError, match=r"components.RouteGenerator: it has no code: fidelity `code` needs a `path`"
    ):
        check_ready(workshop.load(), "code", workshop.vocabulary)


def test_languages_that_do_not_run_yet_are_named(workshop):
    workshop.change("language: rospy", "language: roscpp")
    with pytest.raises(ModelError, match="roscpp components do not run yet; python or rospy do"):
        check_ready(workshop.load(), "code", workshop.vocabulary)


def test_components_without_instances_do_not_matter(workshop):
    workshop.change("  Requester:", "  Unused: {language: c++}\n  Requester:")
    check_ready(workshop.load(), "code", workshop.vocabulary)
