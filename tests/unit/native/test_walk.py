from volery.native.assembly import pieces
from volery.native.code import Block
from volery.native.walk import Machine, walk

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
    Block("leaf", "entry", True),
    Block("step", "entry", True),
    Block("step", "body"),
    Block("step", "exit"),
]
LEAF, ENTRY, BODY, EXIT = range(4)


def test_the_walk_goes_through_calls_loops_and_blocks_without_a_name():
    machine = Machine(BLOCKS, pieces(TEXT))
    walked = walk(machine, [ENTRY, BODY, LEAF, BODY, LEAF, EXIT])
    names = [machine.pieces[number].instructions[0].mnemonic for number in walked.pieces]
    assert names == ["test", "call", "ret", "dec", "call", "ret", "dec", "xor", "ret"]
    assert walked.owners == [ENTRY, BODY, LEAF, BODY, BODY, LEAF, BODY, BODY, EXIT]
    assert walked.taken[3] == 1  # back to the loop
    assert walked.taken[6] == 0  # out of it
    assert walked.lost == 0


def test_what_the_code_generator_left_out_is_skipped():
    blocks = [*BLOCKS, Block("step", "merged")]
    walked = walk(Machine(blocks, pieces(TEXT)), [ENTRY, 4, BODY, LEAF, EXIT])
    assert walked.owners == [ENTRY, BODY, LEAF, BODY, BODY, EXIT]


def test_a_window_that_begins_in_the_middle_is_taken_up():
    walked = walk(Machine(BLOCKS, pieces(TEXT)), [LEAF, BODY, LEAF, EXIT])
    assert walked.owners[:2] == [LEAF, BODY]
