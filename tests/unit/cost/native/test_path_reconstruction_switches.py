"""The comparisons of a switch, as LLVM writes them for both kinds of processor."""

import pytest

from volery.cost.native.machine_code import machine_blocks
from volery.cost.native.path_reconstruction import SwitchResolver


def taken(value: int, *lines: str) -> list[bool | None]:
    """Whether the branch of each piece is taken, shown one after the other."""
    text = "scan: # @scan\n# %bb.0: # %entry\n" + "".join(f"\t{line}\n" for line in lines)
    switch = SwitchResolver(value)
    return [switch.taken(piece) for piece in machine_blocks(text)]


@pytest.mark.parametrize(
    ("condition", "less", "same", "more"),
    [
        ("b.eq", False, True, False),
        ("b.ne", True, False, True),
        ("b.lo", True, False, False),
        ("b.ls", True, True, False),
        ("b.hi", False, False, True),
        ("b.hs", False, True, True),
        ("b.lt", True, False, False),
        ("b.le", True, True, False),
        ("b.gt", False, False, True),
        ("b.ge", False, True, True),
        ("je", False, True, False),
        ("jae", False, True, True),
        ("jl", True, False, False),
    ],
)
def test_conditions(condition: str, less: bool, same: bool, more: bool) -> None:
    register = "eax" if condition.startswith("j") else "w8"
    found = [taken(value, f"cmp\t{register}, 5", f"{condition}\tthere") for value in (4, 5, 6)]
    assert found == [[less], [same], [more]]


def test_an_earlier_subtraction_is_tracked() -> None:
    assert taken(8, "sub\tw9, w8, #9", "cmp\tw9, #2", "b.lo\tthere", "cmp\tw8, #8", "b.eq\tthere") == [
        False,
        True,
    ]
    assert taken(10, "lea\tecx, [rax - 9]", "cmp\tecx, 2", "jb\tthere", "cmp\teax, 32", "je\tthere") == [
        True,
        False,
    ]


def test_a_smaller_register_is_a_part_of_it() -> None:
    assert taken(8, "add\tal, -9", "cmp\tal, 1", "ja\tthere") == [True]
    assert taken(-1, "cmp\teax, 5", "jl\tthere") == [True]
    assert taken(-1, "cmp\teax, 5", "jb\tthere") == [False]


def test_a_branch_that_does_not_depend_on_the_value_is_unknown() -> None:
    assert taken(5, "cmp\tw8, #5", "b.eq\tthere", "cmp\tx1, #5", "b.eq\tthere") == [True, None]
    assert taken(5, "cmp\tw8, w9", "b.eq\tthere") == [None]
    assert taken(5, "cmp\tw8, #5", "ccmp\tx10, #0, #4, ls", "b.ne\tthere") == [None]
    assert taken(5, "cmp\tw8, #5", "b.eq\tthere", "mov\tw8, #3", "cmp\tw8, #5", "b.eq\tthere") == [True, None]


def test_a_chain_passes_a_comparison_once() -> None:
    """Who comes by twice is in a loop, and the value another one."""
    (piece,) = machine_blocks("scan: # @scan\n# %bb.0: # %entry\n\tcmp\tw8, #5\n\tb.eq\tthere\n")
    switch = SwitchResolver(5)
    assert [switch.taken(piece), switch.taken(piece)] == [True, None]
