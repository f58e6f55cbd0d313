import pytest

from volery.base.errors import EstimateError, ModelError
from volery.cost.core import core_law, read_cores


def test_an_unknown_core_names_those_there_are():
    with pytest.raises(EstimateError, match=r"did you mean 'rpi4-cortex-a72'.*intel-i5-3470"):
        core_law("rpi4-cortex-a73")


def test_a_core_runs_at_its_frequencies_only():
    with pytest.raises(EstimateError, match="outside the range of its laws, 600 to 1500 MHz"):
        core_law("rpi4-cortex-a72").check_frequency(2000.0)


@pytest.mark.parametrize(
    ("text", "said"), [("cores: [", "not YAML"), ("processors: {}", "no 'cores'"), ("cores: {a: {}}", "isa")]
)
def test_a_wrong_file_is_told(text, said):
    with pytest.raises(ModelError, match=said):
        read_cores(text, "mine.yaml")
