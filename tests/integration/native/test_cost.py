"""With the real compiler: counts that are known exactly, costs that scale, errors that are the compiler's."""

from __future__ import annotations

import ctypes
import json
import os
import subprocess

import pytest
from typer.testing import CliRunner

from rigs.requirements import lacking
from volery.base.errors import UsageError
from volery.cli.main import application
from volery.cost import load_catalogue
from volery.cost.native import CompilerError, compile_program, instrument
from volery.cost.native.compilation import llvm_toolchain
from volery.cost.native.instrumented_run import Invocation
from volery.cost.native.program_estimate import estimate_program

pytestmark = pytest.mark.integration

SOURCE = """
#include <cmath>
static volatile double kept;
double work(int rounds) {
    double sum = 0.0;
    for (int i = 1; i <= rounds; ++i)
        sum = sum * 0.5 + std::sin(sum + i);
    kept = sum;
    return sum;
}
int main() { work(100); }
"""


@pytest.fixture(scope="module", autouse=True)
def _llvm(tmp_path_factory):
    try:
        llvm_toolchain()
    except UsageError as error:
        lacking(str(error))
    os.environ["VOLERY_CACHE"] = str(tmp_path_factory.mktemp("cache"))
    yield
    del os.environ["VOLERY_CACHE"]


@pytest.fixture
def source(tmp_path):
    file = tmp_path / "work.cpp"
    file.write_text(SOURCE, encoding="utf-8")
    return file


CHOICE = """
static volatile int kept;
static unsigned char data[4096];
void fill(int percent) {
    unsigned long long state = 12345;
    for (auto &one : data) {
        state = state * 6364136223846793005ull + 1442695040888963407ull;
        one = (state >> 33) % 100 < (unsigned)percent;
    }
}
void count() {
    for (int i = 0; i < 4096; ++i)
        if (data[i])
            kept = i;
}
"""


def test_mispredictions_are_charged_to_their_edge(tmp_path):
    """Costs of a run where a branch seldom goes the other way hold for one where it does so often."""
    file = tmp_path / "choice.cpp"
    file.write_text(CHOICE, encoding="utf-8")
    program = compile_program([file], load_catalogue().processor("rpi4-cortex-a72").core_law())
    seldom, often = (
        estimate_program(program, Invocation("count", (f"fill({percent})",))) for percent in (5, 25)
    )
    assert seldom.costs.total(often.counts) == pytest.approx(often.cycles, rel=0.25)
    assert often.cycles > 1.6 * seldom.cycles  # which a mean over both ways would miss


def test_twice_the_rounds_cost_twice_as_much_and_call_twice_as_often(source):
    program = compile_program([source], load_catalogue().processor("rpi4-cortex-a72").core_law())
    once, twice = (estimate_program(program, Invocation(f"work({rounds})")) for rounds in (1000, 2000))
    assert once.library_calls == {"sin": 1000}
    assert twice.cycles == pytest.approx(2 * once.cycles, rel=0.03)
    assert any("sin" in remark for remark in once.left_out)
    assert once.places[0].source.endswith("work.cpp:7")


def test_a_changed_header_is_compiled_and_an_unchanged_one_is_not(tmp_path, monkeypatch):
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    header, file = tmp_path / "rounds.h", tmp_path / "use.c"
    header.write_text("enum { ROUNDS = 10 };\n")
    file.write_text('#include "rounds.h"\nint work(int a) { return a + ROUNDS; }\n')
    before = compile_program([file], law)
    with monkeypatch.context() as without_compiler:
        without_compiler.setattr("volery.cost.native.compilation.run_tool", None)
        assert compile_program([file], law).text == before.text
    header.write_text("enum { ROUNDS = 20 };\n")
    assert compile_program([file], law).text != before.text


def test_programs_run_again_where_nothing_can_be_kept(source, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VOLERY_CACHE", str(tmp_path / "file"))
    program = compile_program([source], load_catalogue().processor("rpi4-cortex-a72").core_law())
    assert estimate_program(program, Invocation("work(10)")).library_calls == {"sin": 10}


def test_the_same_run_costs_the_same_each_time(source):
    program = compile_program([source], load_catalogue().processor("intel-i5-3470").core_law())
    first, second = (estimate_program(program, Invocation("work(500)")) for _ in range(2))
    assert (first.cycles, first.instructions) == (second.cycles, second.instructions)
    assert (first.counts == second.counts).all()


def test_components_get_an_object_that_counts(source, tmp_path):
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    made = instrument([source], law, tmp_path / "work.o")
    library = tmp_path / "libwork.so"
    subprocess.run([llvm_toolchain().clang, "-shared", made.object_file, "-lm", "-o", library], check=True)
    loaded = ctypes.CDLL(str(library))
    length = ctypes.c_uint64.in_dll(loaded, "volery_counters_length").value
    counters = (ctypes.c_uint64 * length).in_dll(loaded, "volery_counters")
    loaded._Z4worki(300)
    rounds = max(counters)
    assert rounds in (300, 150, 75)  # the loop may be unrolled
    assert made.costs.total(list(counters)) > 300 * 10
    assert "code alone" in made.estimated


def test_kept_costs_are_used_for_the_same_code(source, tmp_path):
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    estimate_program(compile_program([source], law), Invocation("work(50)"))
    assert instrument([source], law, tmp_path / "work.o").estimated == ""


def test_the_command_gives_time_and_energy(source):
    done = CliRunner().invoke(
        application(), ["cost", str(source), "--on", "rpi4-cortex-a72@600MHz", "--json"]
    )
    report = json.loads(done.stdout)
    assert done.exit_code == 0
    assert report["time_s"] == pytest.approx(report["cycles"] / 600e6)
    assert report["energy_j"] > 0.0
    assert report["provenance"] == "estimated"


def test_a_compiler_error_is_the_compilers(tmp_path):
    wrong = tmp_path / "wrong.cpp"
    wrong.write_text("int main() { return undeclared; }", encoding="utf-8")
    with pytest.raises(
        CompilerError, match=r"wrong.cpp:1:21: error: use of undeclared identifier 'undeclared'"
    ):
        compile_program([wrong], load_catalogue().processor("rpi4-cortex-a72").core_law())


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("wrok", "did you mean 'work'"),
        ("work", r"takes 1 arguments, not 0: work\(int\)"),
        ("work(x)", "no number"),
    ],
)
def test_a_wrong_entry_is_an_error(source, entry, said):
    program = compile_program([source], load_catalogue().processor("rpi4-cortex-a72").core_law())
    with pytest.raises(UsageError, match=said):
        estimate_program(program, Invocation(entry))


def test_a_crash_is_an_error(tmp_path):
    crashing = tmp_path / "crash.cpp"
    crashing.write_text("int main() { volatile int *p = nullptr; return *p; }", encoding="utf-8")
    with pytest.raises(UsageError, match=r"SIGSEGV|SIGILL|SIGTRAP"):
        estimate_program(
            compile_program([crashing], load_catalogue().processor("rpi4-cortex-a72").core_law()),
            Invocation(),
        )


def test_without_llvm_the_error_names_the_packages(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    llvm_toolchain.cache_clear()
    with pytest.raises(UsageError, match="apt install clang-19 llvm-19"):
        llvm_toolchain()
    llvm_toolchain.cache_clear()


MEMORY = """
#include <cstdint>
#include <vector>
static std::vector<std::uint32_t> circle;
static volatile std::uint32_t kept;
void fill(int kib) {
    std::uint32_t lines = kib * 16, step = 1;
    circle.assign(lines * 16, 0);
    for (std::uint32_t i = 0, at = 0; i < lines; ++i, at = step) {
        step = (at + lines / 2 + 1) % lines;
        circle[at * 16] = step * 16;
    }
}
void chase(int hops) {
    std::uint32_t at = 0;
    for (int i = 0; i < hops; ++i)
        at = circle[at];
    kept = at;
}
"""


def test_caches_cost_cycles_and_memory_costs_time(tmp_path):
    """A circle of loads that each need the one before, in the first cache, the second one, and memory."""
    file = tmp_path / "memory.cpp"
    file.write_text(MEMORY, encoding="utf-8")
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    program = compile_program([file], law)
    first, second, behind = (
        estimate_program(program, Invocation("chase(20000)", (f"fill({kib})",))) for kib in (16, 512, 8192)
    )
    caches = law.memory.caches
    assert first.cycles / 20000 == pytest.approx(caches[0].latency, rel=0.05)
    assert second.cycles / 20000 == pytest.approx(caches[1].latency, rel=0.05)
    assert (first.memory_ns, second.memory_ns) == (0.0, 0.0)
    assert behind.seconds(1500.0) / 20000 == pytest.approx(law.memory.latency_ns * 1e-9, rel=0.05)
    assert behind.seconds(600.0) < 1.3 * behind.seconds(1500.0) < first.seconds(600.0) * 100
    assert first.seconds(600.0) == pytest.approx(2.5 * first.seconds(1500.0))


ASSEMBLY = r"""
#include <cstdint>
static volatile std::uint64_t kept;
static inline std::uint64_t rotl(std::uint64_t x) {
#ifdef __x86_64__
    __asm__("rolq $7, %0" : "+r"(x));
    return x;
#elif defined(__aarch64__)
    __asm__("ror %0, %0, #57" : "+r"(x));
    return x;
#else
    return x << 7 | x >> 57;
#endif
}
void work(int n) { std::uint64_t s = 1; for (int i = 0; i < n; ++i) s = rotl(s + i); kept = s; }
"""

DISTANCE_HEADER = r"""
#pragma once
#include <cstdint>
#if defined(__SSE2__) && \
    !defined(NO_SSE)
#include <emmintrin.h>
inline int sad(const std::uint8_t *a, const std::uint8_t *b) {
    __m128i d = _mm_sad_epu8(_mm_loadu_si128((const __m128i *)a), _mm_loadu_si128((const __m128i *)b));
    return _mm_cvtsi128_si32(d) + _mm_extract_epi16(d, 4);
}
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#error never
#else
inline int sad(const std::uint8_t *a, const std::uint8_t *b) {
    int s = 0;
    for (int i = 0; i < 16; ++i) s += a[i] > b[i] ? a[i] - b[i] : b[i] - a[i];
    return s;
}
#endif
"""

DISTANCE = r"""
#include "sad.h"
static std::uint8_t a[4096], b[4096]; static volatile int kept;
void work(int n) {
    int s = 0;
    for (int k = 0; k < n; ++k)
        for (int i = 0; i < 4096; i += 16)
            s += sad(a + i, b + i);
    kept = s;
}
"""

UNGUARDED = r"""#include <emmintrin.h>
static unsigned char a[16]; static volatile int kept;
void work(int n) {
    __m128i d = _mm_loadu_si128((const __m128i *)a);
    for (int i = 0; i < n; ++i)
        d = _mm_sad_epu8(d, d);
    kept = _mm_cvtsi128_si32(d);
}
"""


def test_code_behind_macros_of_this_machine_takes_the_portable_branch(tmp_path):
    """Inline assembly, an intrinsic in a header, and the same without them cost the same on the target."""
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    files = {"sad.h": DISTANCE_HEADER, "assembly.cpp": ASSEMBLY, "distance.cpp": DISTANCE}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    for name in ("assembly.cpp", "distance.cpp"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        plain = tmp_path / f"plain_{name}"
        plain.write_text(text.replace("__x86_64__", "NO").replace("__aarch64__", "NO"), encoding="utf-8")
        shown = estimate_program(compile_program([tmp_path / name], law), Invocation("work(100)"))
        bare = estimate_program(compile_program([plain], law, ["-DNO_SSE"]), Invocation("work(100)"))
        assert shown.instructions == bare.instructions > 0
        assert not any("asm" in one or "psad" in one for one in shown.library_calls)


def test_on_this_machine_its_own_branch_is_compiled(tmp_path):
    file = tmp_path / "assembly.cpp"
    file.write_text(ASSEMBLY, encoding="utf-8")
    assert "rolq" in compile_program([file], load_catalogue().processor("intel-i5-3470").core_law()).text


def test_code_of_one_instruction_set_without_a_macro_is_an_error_with_line_and_remedy(tmp_path):
    file = tmp_path / "unguarded.cpp"
    file.write_text(UNGUARDED, encoding="utf-8")
    law = load_catalogue().processor("rpi4-cortex-a72").core_law()
    with pytest.raises(CompilerError, match=r"unguarded.cpp:6: the intrinsic _mm_sad_epu8 .*#else"):
        compile_program([file], law)
