import pytest

from volery.cost import load_catalogue
from volery.cost.native import isa_aarch64, isa_x86_64
from volery.cost.native.machine_code import OPERATION_CLASSES, SIMILAR, End, Instruction, machine_blocks

X86 = """\
\t.file\t1 "/src" "step.cpp"
step:                                   # @step
# %bb.0:                                # %entry
\t.loc\t1 7 5                           # step.cpp:7:5
\tpush\trbx
\tcall\tsin@PLT
\ttest\tedi, edi
\tjle\t.LBB0_2
# %bb.1:                                # %body
\tlea\teax, [rdi + 2*rdi]
\tjmp\tother@PLT                        # TAILCALL
.LBB0_2:
\tjmp\trax
\tret
.Lfunc_end0:
"""


def read(text: str) -> Instruction:
    mnemonic, _, rest = text.partition(" ")
    made = machine_blocks(f"f:  # @f\n# %bb.0:\n\t{mnemonic}\t{rest}\n")
    return made[0].instructions[0]


def test_machine_blocks_end_in_calls_branches_jumps_and_returns():
    found = machine_blocks(X86)
    assert [(piece.end, piece.target) for piece in found] == [
        (End.CALL, "sin"),
        (End.BRANCH, ".LBB0_2"),
        (End.JUMP, "other"),
        (End.COMPUTED, ""),
        (End.RETURN, ""),
    ]
    assert [piece.came_from for piece in found] == ["entry", "entry", "body", None, None]
    assert found[0].instructions[0].source == "/src/step.cpp:7"


@pytest.mark.parametrize(
    ("text", "operation", "reads", "writes"),
    [
        ("addsd xmm0, xmm1", "fp_add", {"xmm0", "xmm1"}, {"xmm0"}),
        ("sqrtsd xmm3, xmm2", "fp_root64", {"xmm2", "xmm3"}, {"xmm3"}),
        ("ucomisd xmm0, xmm1", "fp_flags", {"xmm0", "xmm1"}, {"flags"}),
        ("mov eax, ecx", "move", {"rcx"}, {"rax"}),
        ("add eax, 4", "increment", {"rax"}, {"rax", "flags"}),
        ("add eax, ecx", "alu", {"rax", "rcx"}, {"rax", "flags"}),
        ("cmovl eax, edi", "conditional", {"rax", "rdi", "flags"}, {"rax"}),
        ("idiv ecx", "divide32", {"rax", "rdx", "rcx"}, {"rax", "rdx", "flags"}),
        ("movq rax, xmm0", "transfer", {"xmm0"}, {"rax"}),
        ("cvtsi2sd xmm0, eax", "convert_integer", {"xmm0", "rax"}, {"xmm0"}),
        ("cvttsd2si eax, xmm0", "convert_integer", {"xmm0"}, {"rax"}),
        ("cvtss2sd xmm0, xmm1", "convert", {"xmm0", "xmm1"}, {"xmm0"}),
        ("pslld xmm0, 3", "vector_shift", {"xmm0"}, {"xmm0"}),
        ("psadbw xmm0, xmm1", "vector_multiply", {"xmm0", "xmm1"}, {"xmm0"}),
        ("call rax", "branch", {"rax"}, set()),
        ("call foo@PLT", "branch", set(), set()),
        ("xorps xmm0, xmm0", "", set(), {"xmm0"}),
        ("lea rax, [rcx + 8*rdx + 4]", "shifted_alu", {"rcx", "rdx"}, {"rax"}),
        ("jne .LBB0_1", "branch", {"flags"}, set()),
    ],
)
def test_x86(text, operation, reads, writes):
    found = isa_x86_64.effect(read(text))
    assert (found.operation, set(found.reads), set(found.writes)) == (operation, reads, writes)


def test_x86_reads_and_writes_memory_at_once():
    found = isa_x86_64.effect(read("add qword ptr [rbx + 8*rcx - 16], rax"))
    assert (found.load, found.operation, found.store) == ("load", "alu", "store")
    assert (found.memory.registers, found.memory.displacement, found.memory.size) == (("rbx", "rcx"), -16, 8)


@pytest.mark.parametrize(
    ("text", "operation", "reads", "writes"),
    [
        ("fadd d0, d1, d2", "fp_add", {"v1", "v2"}, {"v0"}),
        ("fmadd d0, d1, d2, d3", "fp_fma", {"v1", "v2", "v3"}, {"v0"}),
        ("fmla v0.2d, v1.2d, v2.2d", "fp_fma", {"v0", "v1", "v2"}, {"v0"}),
        ("fdiv s0, s1, s2", "fp_divide32", {"v1", "v2"}, {"v0"}),
        ("udiv x0, x1, x2", "divide64", {"x1", "x2"}, {"x0"}),
        ("mul w0, w1, w2", "multiply", {"x1", "x2"}, {"x0"}),
        ("add x0, x1, x2, lsl #3", "alu", {"x1", "x2"}, {"x0"}),
        ("add x0, x1, x2, asr #7", "shifted_alu", {"x1", "x2"}, {"x0"}),
        ("subs w0, w0, #1", "alu", {"x0"}, {"x0", "flags"}),
        ("csel w0, w1, wzr, lt", "alu", {"x1", "flags"}, {"x0"}),
        ("scvtf d0, w1", "transfer", {"x1"}, {"v0"}),
        ("b.ne .LBB0_1", "branch", {"flags"}, set()),
        ("clrex", "alu", set(), set()),
    ],
)
def test_a64(text, operation, reads, writes):
    found = isa_aarch64.effect(read(text))
    assert (found.operation, set(found.reads), set(found.writes)) == (operation, reads, writes)


def test_a64_load_pair_with_address_write_back():
    found = isa_aarch64.effect(read("ldp x0, x1, [x2], #16"))
    assert (found.load, set(found.writes), found.bumps, found.memory.size) == (
        "load",
        {"x0", "x1"},
        ("x2",),
        16,
    )


def test_x86_virtual_call_loads_its_target():
    found = isa_x86_64.effect(read("call qword ptr [rax + 16]"))
    assert (found.load, found.operation, found.memory.registers) == ("load", "branch", ("rax",))


def test_every_operation_has_figures_on_every_core():

    known = [one.core_law() for one in load_catalogue().processors.values() if one.core_model is not None]
    assert len(known) == 2
    assert all(set(law.operations) >= set(OPERATION_CLASSES) - set(SIMILAR) for law in known)
    assert all(similar in law.operations for law in known for similar in SIMILAR.values())


def test_padding_before_a_loop_is_executed():
    begin = "f:  // @f\n// %bb.0:  // %entry\n\tnop\n\tnop\n\tb.eq\t.LBB0_1\n"
    text = begin + "\t.p2align\t4, , 8\n.LBB0_1:  // %exit\n\tret\n"
    assert [len(piece.instructions) for piece in machine_blocks(text, bytes_each=4)] == [3, 1, 1]
    assert [len(piece.instructions) for piece in machine_blocks(text)] == [3, 1]
