"""Accesses that the first cache did not serve: recorded by the code, assigned to the machine code."""

from __future__ import annotations

from volery.cost import load_catalogue
from volery.cost.native.block_costs import cache_misses
from volery.cost.native.instruction_tables import instruction_tables
from volery.cost.native.instrumented_run import Access, BlockTrace
from volery.cost.native.llvm_ir import BasicBlock, access_counts, is_access, with_access_calls
from volery.cost.native.machine_code import machine_blocks
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
    said = [
        line.strip()
        for line in with_access_calls(iter(lines), lambda line: line.startswith("end"))
        if line not in lines
    ]
    assert said == [
        "call void @volery_access(ptr %p, i32 0)",
        "call void @volery_access(ptr getelementptr inbounds (i8, ptr @buffer, i64 4), i32 3)",
        'call void @volery_access(ptr %"odd name", i32 4)',
        "call void @volery_access(ptr %q, i32 7)",
        "call void @volery_range(ptr %d, i64 %n)",
        "call void @volery_range(ptr @src, i64 %n)",
        "call void @volery_range(ptr %d, i64 64)",
        'call void @volery_access(ptr %"odd name", i32 0)',
    ]


def test_loads_and_stores_are_accesses() -> None:
    assert access_counts(TEXT) == [4, 1]
    assert not is_access("  call void @store(ptr %p)")


ASSEMBLY = """\
f:                                      # @f
# %bb.0:                                # %entry
\tpush\trbx
\tmov\teax, dword ptr [rdi]
\tmov\tdword ptr [rsi], eax
\tmov\tecx, dword ptr [rdi + 64]
\tcall\tother
\tmov\tdword ptr [rsi + 64], ecx
\tret
.Lfunc_end0:
"""


def test_accesses_fall_on_loads_and_stores_at_their_place_in_the_block() -> None:
    made = machine_blocks(ASSEMBLY)
    machine = MachineCode([BasicBlock("f", "entry", True)], made)
    tables = instruction_tables(
        made, load_catalogue().processor("intel-i5-3470").core_law(), frozenset({"f"})
    )
    recorded = [Access(0, False, 1, False), Access(2, False, 2, True), Access(3, True, 3, False)]
    misses = cache_misses(reconstruct_path(machine, BlockTrace([0], accesses={0: recorded})), tables, [4])
    assert misses.tolist() == [[0, 1, 1, 0], [0, 3, 2, 1], [1, 5, 3, 0]]


def test_no_misses_without_recorded_accesses() -> None:
    made = machine_blocks(ASSEMBLY)
    machine = MachineCode([BasicBlock("f", "entry", True)], made)
    tables = instruction_tables(
        made, load_catalogue().processor("intel-i5-3470").core_law(), frozenset({"f"})
    )
    assert cache_misses(reconstruct_path(machine, BlockTrace([0])), tables, [4]).shape == (0, 4)
