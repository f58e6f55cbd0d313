"""Machine code: object code and numba give the same bits, and both report what is wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from volery.base import numeric_code
from volery.base.errors import UsageError
from volery.base.numeric_code import NumericCode, digest_of, numeric

SCRIPTS = Path(__file__).parents[3] / "scripts"
ARGUMENTS = ("float64[:,::1]", "int64[::1]", "float64")


@numeric
def _scaled(value, factor):
    return value / factor + 0.1


def _compose(digest):
    def scale_rows(rows, counts, factor):
        finite = True
        for row in range(rows.shape[0]):
            for column in range(rows.shape[1]):
                rows[row, column] = _scaled(rows[row, column], factor)
                finite = finite and rows[row, column] - rows[row, column] == 0.0
            counts[row] += 1
        return 1 if digest and finite else 0

    return scale_rows


def entry():
    return NumericCode("scale_rows", _compose, [Path(__file__)], ARGUMENTS)


def rows():
    return np.linspace(0.1, 7.3, 12).reshape(4, 3), np.zeros(4, dtype=np.int64)


@pytest.fixture
def object_code(tmp_path, monkeypatch):
    monkeypatch.setattr(numeric_code, "OBJECT_CODE", tmp_path)
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import compile_numerics

    return compile_numerics


def test_a_numeric_function_is_plain_python():
    assert _scaled(2.0, 4.0) == 0.6


def test_what_is_compiled_is_announced_once(caplog):
    first, second = entry(), entry()
    first.by_numba(cache=True)  # fills the cache, unless an earlier run has
    caplog.clear()
    second.by_numba(cache=True)
    assert not caplog.messages
    second.by_numba(cache=False)
    assert [one.split(",")[0] for one in caplog.messages] == ["compiling scale_rows for this computer"]


def test_without_object_code_numba_executes_it(tmp_path, monkeypatch):
    monkeypatch.setattr(numeric_code, "OBJECT_CODE", tmp_path)
    values, counts = rows()
    expected = values / 3.0 + 0.1
    call = entry().bind(values, counts, 3.0)
    call()
    assert np.array_equal(values, expected)
    call()
    assert counts.tolist() == [2, 2, 2, 2]
    with pytest.raises(ArithmeticError, match="scale_rows"):
        entry().bind(values, counts, 0.0)()


def test_object_code_gives_the_bits_of_numba_and_reports_invalid_arithmetic(object_code):
    by_numba, counts = rows()
    entry().bind(by_numba, counts, 3.0)()
    object_code.build(entry(), object_code.find_linker())
    code = entry()
    assert code.shipped
    by_object_code, counts = rows()
    code.bind(by_object_code, counts, 3.0)()
    assert by_object_code.tobytes() == by_numba.tobytes()
    assert counts.tolist() == [1, 1, 1, 1]
    with pytest.raises(ArithmeticError, match="scale_rows"):
        code.bind(by_object_code, counts, 0.0)()


def test_object_code_of_other_sources_is_not_used_and_is_removed(object_code, tmp_path):
    old = tmp_path / "scale_rows-x86_64-0123456789abcdef.so"
    old.write_bytes(b"")
    assert not entry().shipped
    object_code.build(entry(), object_code.find_linker())
    assert not old.exists()


@pytest.mark.parametrize(
    "wrong",
    [np.zeros((4, 3), dtype=np.float32), np.zeros((3, 4)).T, np.zeros(12), [[0.0] * 3] * 4],
    ids=["type", "layout", "dimensions", "list"],
)
def test_arguments_of_another_type_or_layout_are_refused(wrong):
    with pytest.raises(UsageError, match=r"scale_rows: an argument must be .* float64\[:,::1\]"):
        entry().bind(wrong, np.zeros(4, dtype=np.int64), 3.0)


def test_the_digest_of_sources_changes_with_any_source(tmp_path):
    one, two = tmp_path / "one.py", tmp_path / "two.py"
    one.write_text("a = 1\n")
    two.write_text("b = 1\n")
    before = digest_of([one, two])
    assert digest_of([two, one]) == before
    two.write_text("b = 2\n")
    assert digest_of([one, two]) != before


def test_a_fleet_needs_no_numba_until_it_moves():
    import subprocess

    check = "import sys, volery.run.assembly.simulated_fleet; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
