"""Accesses to memory: recorded by the code, assigned to the instructions of the machine code."""

from __future__ import annotations

import numpy as np

from volery.cost import load_catalogue
from volery.cost.native.block_costs import ExecutedAccesses, executed_accesses
from volery.cost.native.instruction_tables import instruction_tables
from volery.cost.native.instrumented_run import BlockTrace
from volery.cost.native.llvm_ir import (
    BasicBlock,
    access_blocks,
    is_access,
    with_access_calls,
    with_access_columns,
)
from volery.cost.native.machine_code import NO_LINE, machine_blocks
from volery.cost.native.path_reconstruction import MachineCode, reconstruct_path

TEXT = """\
define void @mix(ptr %p, i64 %n) {
entry:
  %a = load i32, ptr %p, align 4, !tbaa !5
  store i32 %a, ptr getelementptr inbounds (i8, ptr @buffer, i64 4), align 4
  %b = load <4 x float>, ptr %"odd name", align 16
  store volatile { ptr, i32 } zeroinitializer, ptr %q, align 8
  call void @llvm.memcpy.p0.p0.i64(ptr nonnull align 8 %d, ptr dereferenceable(24) @src, i64 %n, i1 0)
  call void @llvm.memset.p0.i64(ptr align 4 %d, i8 0, i64 64, i1 0)
  br label %end
end:
  %c = load atomic i32, ptr %"odd name" syncscope("singlethread") acquire, align 8
  ret void
}
"""


def test_every_access_is_recorded_before_it_is_made() -> None:
    lines = TEXT.splitlines(keepends=True)
    said = [line.strip() for line in with_access_calls(lines) if line not in lines]
    assert said == [
        "call void @volery_access(ptr %p, i32 0)",
        "call void @volery_access(ptr getelementptr inbounds (i8, ptr @buffer, i64 4), i32 3)",
        'call void @volery_access(ptr %"odd name", i32 4)',
        "call void @volery_access(ptr %q, i32 7)",
        "call void @volery_range(ptr %d, i64 %n)",
        "call void @volery_range(ptr @src, i64 %n)",
        "call void @volery_range(ptr %d, i64 64)",
        'call void @volery_access(ptr %"odd name", i32 8)',
    ]


def test_loads_and_stores_are_accesses() -> None:
    assert access_blocks(TEXT) == [0, 0, 0, 0, 1]
    assert not is_access("  call void @store(ptr %p)")


LOCATED = """\
define double @f(ptr %p) !dbg !3 {
entry:
  %a = load float, ptr %p, !dbg !7
  %wide = fpext float %a to double, !dbg !8
  %b = load double, ptr %q, !dbg !7
  %sum = fadd double %wide, %b, !dbg !8
  %twice = fmul double %b, %sum, !dbg !8
  store double %twice, ptr %q, align 8
  ret double %sum, !dbg !8
}
define double @g(ptr %p) {
  %a = load double, ptr %p
  ret double %a
}
!3 = distinct !DISubprogram(name: "f")
!7 = !DILocation(line: 5, column: 3, scope: !3)
!8 = !DILocation(line: 6, scope: !3)
"""


def test_an_access_and_its_only_use_have_its_number_as_their_column() -> None:
    lines = with_access_columns(LOCATED).splitlines()
    nodes = {line.split()[0]: line for line in lines if "DILocation" in line}
    found = []
    for line in lines[2:9]:
        node = nodes.get(line.partition("!dbg ")[2], "")
        found.append(node.partition("(")[2])
    assert found == [
        "line: 5, column: 1, scope: !3)",
        "line: 6, column: 1, scope: !3)",  # a load that extends
        "line: 5, column: 2, scope: !3)",
        "line: 6, column: 1, scope: !3)",  # the sum may be of a register and memory
        "line: 6, scope: !3)",  # %b is used twice
        f"line: {NO_LINE}, column: 3, scope: !3)",
        "line: 6, scope: !3)",
    ]
    assert lines[10:14] == LOCATED.splitlines()[10:14]


ASSEMBLY = """\
f:                                      # @f
# %bb.0:                                # %entry
\tpush\trbx
\t.loc\t1 7 1
\tmov\teax, dword ptr [rdi]
\t.loc\t1 7 2
\tmov\tdword ptr [rsi], eax
\tmov\tqword ptr [rsp], rdi            # 8-byte Spill
\tmulsd\txmm0, qword ptr [rip + .LCPI0_0] # [1.0E+0]
\t.loc\t1 8 3
\tmov\tecx, dword ptr [rdi + 64]
\tcall\tother
\t.loc\t1 9 4
\tmov\tdword ptr [rsi + 64], ecx
\tret
.Lfunc_end0:
"""
PUSH, LOAD, STORE, SPILL, CONSTANT, SECOND, CALL, LAST, RETURN = range(9)


def found(trace: BlockTrace) -> ExecutedAccesses:
    made = machine_blocks(ASSEMBLY)
    machine = MachineCode([BasicBlock("f", "entry", True)], made)
    tables = instruction_tables(
        made, load_catalogue().processor("intel-i5-3470").core_law(), frozenset({"f"})
    )
    numbers = np.array([one.access - 1 for block in made for one in block.instructions])
    return executed_accesses(reconstruct_path(machine, trace), tables, numbers)


def test_instructions_have_address_and_level_of_their_access() -> None:
    accesses = np.array([[0, 0, 1, 0, 640], [0, 1, 0, 0, 8], [0, 2, 2, 1, 704], [0, 3, 3, 0, 72]])
    made = found(BlockTrace([0], accesses=accesses))
    assert made.misses.tolist() == [[0, LOAD, 1, 0], [0, SECOND, 2, 1], [1, LAST, 3, 0]]
    addresses = {LOAD: 640, STORE: 8, SECOND: 704, LAST: 72}
    assert made.addresses.tolist() == [addresses.get(row, -1) for row in range(9)]


def test_each_entry_of_a_block_has_addresses_of_its_own_or_those_before() -> None:
    accesses = np.array([[0, 1, 0, 0, 8], [1, 1, 0, 0, 16], [3, 1, 0, 0, 24]])
    made = found(BlockTrace([0, 0, 0, 0], accesses=accesses))
    assert made.addresses.reshape(4, -1)[:, STORE].tolist() == [8, 16, 16, 24]


def test_nothing_is_known_without_recorded_accesses() -> None:
    made = found(BlockTrace([0]))
    assert made.misses.shape == (0, 4)
    assert made.addresses.tolist() == [-1] * 9
