"""Conditions on the instruction set, and code that cannot be compiled for another one."""

from __future__ import annotations

import pytest

from volery.cost.native.compilation import foreign_code, with_target_macros, without_hints


def test_conditions_of_this_machine_are_false_and_those_of_the_target_true():
    text = (
        "#ifdef __x86_64__\n#elif defined(__aarch64__)\n#endif\n"
        "#  if defined(__SSE2__) || \\\n    defined __AVX512F__\n#endif\n#define FAST __SSE4_1__\n"
    )
    seen = with_target_macros(text, "aarch64")
    assert "__x86_64__" not in seen
    assert "__SSE" not in seen
    assert "__AVX" not in seen
    assert "#elif defined(VOLERY_TARGET_AARCH64)\n" in seen
    assert seen.count("\n") == text.count("\n")


def test_what_is_no_condition_is_left_as_it_is():
    text = '#include <a/__x86_64__.h>\nconst char *name = "__SSE2__";\n#if __SSE2__x\n'
    assert with_target_macros(text, "aarch64") == text


CALL = "define void @work() {\n  {}, !dbg !7\n}\n"
LINES = (
    "!7 = !DILocation(line: 12, column: 3, scope: !8)\n!8 = distinct !DILexicalBlock(scope: !9, line: 1)\n"
    '!9 = distinct !DISubprogram(name: "work", scope: !1, file: !2, line: 9)\n'
    '!2 = !DIFile(filename: "/src/fast, and odd.cpp", directory: "/src")\n'
)


@pytest.mark.parametrize(
    ("instruction", "named"),
    [
        ('call void asm sideeffect "cpuid", "~{eax}"()', "inline assembly 'cpuid'"),
        ("%1 = call <2 x i64> @llvm.x86.sse2.psad.bw(<16 x i8> %0)", "intrinsic llvm.x86.sse2.psad.bw"),
    ],
)
def test_code_of_one_instruction_set_is_named_with_file_and_line(instruction, named):
    found = foreign_code(CALL.replace("{}", instruction) + LINES)
    assert found.startswith("/src/fast, and odd.cpp:12: ")
    assert named in found


def test_barriers_and_pauses_are_no_code_of_one_instruction_set():
    text = CALL.replace("{}", 'call void asm sideeffect "", "~{memory}"()') + LINES
    assert foreign_code(text) == ""
    assert foreign_code(without_hints(CALL.replace("{}", "call void @llvm.x86.sse2.pause()") + LINES)) == ""
