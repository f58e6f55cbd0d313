"""Estimates of a filter written with Eigen, the matrix library of much robotics code."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigs.requirements import lacking
from volery.base.errors import UsageError
from volery.cost import load_catalogue
from volery.cost.native import compile_program
from volery.cost.native.compilation import llvm_toolchain
from volery.cost.native.instrumented_run import Invocation
from volery.cost.native.program_estimate import estimate_program

pytestmark = pytest.mark.integration

HEADERS = Path("/usr/include/eigen3")

FILTER = """
#include <Eigen/Dense>

using State = Eigen::Matrix<double, 6, 1>;
using Covariance = Eigen::Matrix<double, 6, 6>;

static State state = State::Zero();
static Covariance covariance = Covariance::Identity();
static volatile double kept;

void work(int steps) {
    Covariance transition = Covariance::Identity();
    transition.topRightCorner<3, 3>() = 0.02 * Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 3, 6> observed = Eigen::Matrix<double, 3, 6>::Zero();
    observed.leftCols<3>().setIdentity();
    for (int step = 0; step < steps; ++step) {
        state = transition * state;
        covariance = transition * covariance * transition.transpose() + 0.01 * Covariance::Identity();
        Eigen::Matrix3d spread = observed * covariance * observed.transpose() + Eigen::Matrix3d::Identity();
        Eigen::Matrix<double, 6, 3> gain = covariance * observed.transpose() * spread.inverse();
        state += gain * (Eigen::Vector3d(step, 1.0, 2.0) - observed * state);
        covariance = (Covariance::Identity() - gain * observed) * covariance;
    }
    kept = state.norm() + covariance.trace();
}
"""


@pytest.fixture(scope="module", autouse=True)
def _needed():
    try:
        llvm_toolchain()
    except UsageError as error:
        lacking(str(error))
    if not HEADERS.is_dir():
        lacking("no headers of Eigen (scripts/debian-packages libeigen3-dev)")


@pytest.fixture(scope="module")
def instructions(tmp_path_factory):
    """Instructions of 20 and 40 steps by processor and whether Eigen may vectorise."""
    file = tmp_path_factory.mktemp("eigen") / "filter.cpp"
    file.write_text(FILTER, encoding="utf-8")
    catalogue = load_catalogue()
    found = {}
    for kind in ("rpi4-cortex-a72", "intel-i5-3470"):
        for flags in ([], ["-DEIGEN_DONT_VECTORIZE"]):
            law = catalogue.processor(kind).core_law()
            program = compile_program([file], law, [f"-I{HEADERS}", *flags])
            made = [estimate_program(program, Invocation(f"work({steps})")) for steps in (20, 40)]
            assert not [one for one in made[0].library_calls if "llvm." in one]
            found[kind, not flags] = tuple(one.instructions for one in made)
    return found


def test_each_step_costs_the_same_and_no_less_than_its_products(instructions):
    for few, many in instructions.values():
        step = (many - few) / 20
        assert step > 1264 / 2  # products of numbers in a step, two in a vector
        assert step == pytest.approx(few / 20, rel=0.02)


def test_vectors_of_this_machine_save_instructions_here_and_are_not_assumed_on_the_target(instructions):
    assert instructions["intel-i5-3470", True][0] < 0.8 * instructions["intel-i5-3470", False][0]
    there, plain = instructions["rpi4-cortex-a72", True][0], instructions["rpi4-cortex-a72", False][0]
    assert there == pytest.approx(plain, rel=0.05)
