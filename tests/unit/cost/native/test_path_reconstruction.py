import pytest

from volery.cost.native.instrumented_run import BlockTrace
from volery.cost.native.llvm_ir import BasicBlock
from volery.cost.native.machine_code import machine_blocks
from volery.cost.native.path_reconstruction import MachineCode, reconstruct_path

# a loop whose exit edge has a block of its own, and a callee
TEXT = """\
leaf:                                   # @leaf
# %bb.0:                                # %entry
\tret
.Lfunc_end0:
step:                                   # @step
# %bb.0:                                # %entry
\ttest\tedi, edi
\tjle\t.LBB1_3
.LBB1_1:                                # %body
\tcall\tleaf
\tdec\tedi
\tjne\t.LBB1_1
# %bb.2:
\txor\teax, eax
.LBB1_3:                                # %exit
\tret
.Lfunc_end1:
"""
BLOCKS = [
    BasicBlock("leaf", "entry", True),
    BasicBlock("step", "entry", True),
    BasicBlock("step", "body"),
    BasicBlock("step", "exit"),
]
LEAF, ENTRY, BODY, EXIT = range(4)


def test_calls_loops_and_unnamed_blocks_are_followed():
    machine = MachineCode(BLOCKS, machine_blocks(TEXT))
    walked = reconstruct_path(machine, BlockTrace([ENTRY, BODY, LEAF, BODY, LEAF, EXIT]))
    names = [machine.machine_blocks[number].instructions[0].mnemonic for number in walked.blocks]
    assert names == ["test", "call", "ret", "dec", "call", "ret", "dec", "xor", "ret"]
    assert walked.owners == [ENTRY, BODY, LEAF, BODY, BODY, LEAF, BODY, BODY, EXIT]
    assert walked.taken[3] == 1  # back to the loop
    assert walked.taken[6] == 0  # out of it
    assert walked.lost == 0


def test_blocks_without_machine_code_are_skipped():
    blocks = [*BLOCKS, BasicBlock("step", "merged")]
    walked = reconstruct_path(
        MachineCode(blocks, machine_blocks(TEXT)), BlockTrace([ENTRY, 4, BODY, LEAF, EXIT])
    )
    assert walked.owners == [ENTRY, BODY, LEAF, BODY, BODY, EXIT]


def test_a_window_may_begin_inside_a_function():
    walked = reconstruct_path(MachineCode(BLOCKS, machine_blocks(TEXT)), BlockTrace([LEAF, BODY, LEAF, EXIT]))
    assert walked.owners[:2] == [LEAF, BODY]


# a caller whose block goes on after a call of a library, and a callee whose last two blocks are one piece
AFTER_CALLS = """\
callee:                                 # @callee
# %bb.0:                                # %entry
\ttest\tedi, edi
\tje\t.LBB0_2
# %bb.1:                                # %then
\tjmp\tfree
.LBB0_2:                                # %exit
\tret
.Lfunc_end0:
caller:                                 # @caller
# %bb.0:                                # %entry
\tcall\tcallee
\tcall\tcallee
\ttest\teax, eax
\tje\t.LBB1_2
# %bb.1:                                # %then
\tcall\tfree
.LBB1_2:                                # %exit
\tje\t.LBB1_4
# %bb.3:                                # %rest
\tjmp\tfree
.LBB1_4:                                # %last
\tret
.Lfunc_end1:
"""
CALLEE = [BasicBlock("callee", "entry", True), BasicBlock("callee", "then"), BasicBlock("callee", "exit")]
CALLER = [BasicBlock("caller", name, name == "entry") for name in ("entry", "then", "exit", "rest", "last")]


def test_a_call_is_followed_though_blocks_of_the_callee_before_it_were_merged():
    machine = MachineCode([*CALLEE, *CALLER], machine_blocks(AFTER_CALLS))
    walked = reconstruct_path(machine, BlockTrace([3, 0, 1, 2, 0, 2, 7]))
    assert walked.owners == [3, 0, 1, 3, 0, 2, 3, 3, 7]


def test_the_block_after_the_call_of_a_library_is_entered():
    machine = MachineCode([*CALLEE, *CALLER], machine_blocks(AFTER_CALLS))
    walked = reconstruct_path(machine, BlockTrace([3, 0, 2, 0, 2, 4, 5, 7]))
    assert walked.owners[-3:] == [4, 5, 7]
    assert walked.lost == 0


# several ways of one switch lead to the same block
SWITCH = """\
scan:                                   // @scan
// %bb.0:                               // %entry
\tcmp\tw8, #31
\tb.gt\t.LBB0_3
// %bb.1:                               // %entry
\tsub\tw9, w8, #9
\tcmp\tw9, #2
\tb.hs\t.LBB0_5
.LBB0_2:                                // %blank
\tret
.LBB0_3:                                // %entry
\tcmp\tw8, #32
\tb.eq\t.LBB0_2
// %bb.4:                               // %entry
\tcmp\tw8, #123
\tb.eq\t.LBB0_2
.LBB0_5:                                // %other
\tret
.Lfunc_end0:
"""


@pytest.mark.parametrize(
    ("value", "to", "compared"),
    [(9, 1, 2), (10, 1, 2), (11, 2, 2), (32, 1, 2), (65, 2, 3), (123, 1, 3)],
)
def test_the_value_of_a_switch_decides_between_equal_ways(value: int, to: int, compared: int):
    machine = MachineCode(
        [BasicBlock("scan", "entry", True), BasicBlock("scan", "blank"), BasicBlock("scan", "other")],
        machine_blocks(SWITCH, 4),
    )
    walked = reconstruct_path(machine, BlockTrace([0, to], {1: value}))
    assert walked.owners == [0] * compared + [to]


def test_a_stall_is_charged_to_the_edge_that_was_taken():
    """Of the block that stands between the loop and its exit there is nothing in the machine code."""
    blocks = [*BLOCKS, BasicBlock("step", "body.exit_crit_edge")]
    walked = reconstruct_path(
        MachineCode(blocks, machine_blocks(TEXT)), BlockTrace([ENTRY, BODY, LEAF, BODY, LEAF, 4, EXIT])
    )
    assert walked.owners == [ENTRY, BODY, LEAF, BODY, BODY, LEAF, BODY, BODY, EXIT]
    assert walked.reached == [ENTRY, BODY, LEAF, BODY, BODY, LEAF, BODY, BODY, 4]
