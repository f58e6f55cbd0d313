"""What is found in an FMU, and what is said of one that cannot move a body."""

import pytest

from rigs.multirotor_fmu import make_fmu
from volery.base.errors import UsageError
from volery.model.fmu_bodies import Fmu, FmuVariables
from volery.simulation.fmu.fmu_interface import read_interface


def test_scalars_of_fmi_2_and_arrays_of_fmi_3_are_found_by_the_same_names(tmp_path):
    scalars = read_interface(Fmu(make_fmu(tmp_path / "two.fmu", 2)), 4)
    arrays = read_interface(Fmu(make_fmu(tmp_path / "three.fmu", 3)), 4)
    assert (scalars.version, arrays.version) == (2, 3)
    assert scalars.inputs.widths == arrays.inputs.widths
    assert scalars.outputs.widths == {
        "position": 3, "velocity": 3, "attitude": 4, "rates": 3, "rotor_speeds": 4
    }  # fmt: skip
    assert scalars.inputs.references == tuple(range(13))
    assert arrays.inputs.references == (0, 4, 7, 8, 9, 10)


def test_a_quantity_may_have_a_name_for_each_value_and_parameters_keep_their_type(tmp_path):
    names = FmuVariables(position=("velocity[3]", "velocity[1]", "velocity[2]"))
    interface = read_interface(
        Fmu(make_fmu(tmp_path / "quad.fmu"), variables=names, parameters={"fail_at": 3}), 4
    )
    assert interface.outputs.references[:3] == (18, 16, 17)
    assert interface.parameters == (("Real", 30, 3.0),)


OPTIONAL = ("wind", "ground", "voltage", "load", "push", "rotor_speeds")


def test_what_is_optional_may_be_absent(tmp_path):
    interface = read_interface(Fmu(make_fmu(tmp_path / "quad.fmu", without=OPTIONAL)), 4)
    assert interface.inputs.widths == {"commands": 4}
    assert "rotor_speeds" not in interface.outputs.widths


@pytest.mark.parametrize(
    ("made", "stated", "rotors", "says"),
    [
        ({"kind": "ModelExchange"}, {}, 4, "is for model exchange only; export it for co-simulation"),
        ({"platform": "win64"}, {}, 4, r"which is linux64: it has win64; export it for that"),
        ({"code": False}, {}, 4, "it has no machine code; export it for that"),
        (
            {"version": 3, "fixed_step": 0.0015},
            {},
            4,
            r"steps by 0.0015 s inside; the world steps by 0.002 s",
        ),
        (
            {"without": ("rates", "attitude")},
            {},
            4,
            r"no variable for rates, attitude or angles; name it below",
        ),
        ({"without": ("rates",)}, {}, 4, r"its outputs are position\[1\], position\[2\], .* and \d more"),
        ({}, {}, 6, "has no variable for commands"),
        ({"version": 3}, {}, 6, "gives commands another number of values than 6"),
        (
            {},
            {"variables": FmuVariables(wind=("wnd",))},
            4,
            r"no variable 'wnd\[1\]' for wind \(did you mean",
        ),
        (
            {},
            {"variables": FmuVariables(wind=("a", "b"))},
            4,
            "needs 3 names for wind, or one; the model states 2",
        ),
        (
            {},
            {"variables": FmuVariables(ground=("fail_at",))},
            4,
            "has fail_at as parameter; ground is an input",
        ),
        ({}, {"parameters": {"failat": 1.0}}, 4, r"has no parameter 'failat' \(did you mean 'fail_at'\?\)"),
        ({}, {"parameters": {"ground": 1.0}}, 4, "has no parameter 'ground'"),
    ],
)
def test_an_fmu_that_cannot_move_a_body_is_named_with_what_to_do(tmp_path, made, stated, rotors, says):
    file = make_fmu(tmp_path / "quad.fmu", **made)
    with pytest.raises(UsageError, match=says) as raised:
        read_interface(Fmu(file, **stated), rotors)
    assert str(file) in str(raised.value)


@pytest.mark.parametrize(
    ("octets", "says"),
    [
        (None, "No such file"),
        (b"an archive", "is no FMU: an FMU is a zip archive with a modelDescription.xml"),
        (b"", "is no FMU"),
    ],
)
def test_another_file_is_refused(tmp_path, octets, says):
    make_fmu(tmp_path / "quad.fmu", code=False)  # skips without FMPy
    file = tmp_path / "other.fmu"
    if octets is not None:
        file.write_bytes(octets)
    with pytest.raises(UsageError, match=says):
        read_interface(Fmu(file), 4)
