"""Records of the files that a compilation has read."""

from __future__ import annotations

import pytest

from volery.base.dependency_record import is_current, rule_dependencies, write_record


def test_a_make_rule_names_its_files():
    rule = "x.o: /a/b.cpp \\\n /usr/in\\ clude/c.h \\\n d.h\n"
    assert rule_dependencies(rule) == ["/a/b.cpp", "/usr/in clude/c.h", "d.h"]


@pytest.mark.parametrize("change", ["edited", "removed"])
def test_a_record_is_current_until_a_file_changes(tmp_path, change):
    header, record = tmp_path / "a.h", tmp_path / "record"
    header.write_text("int a;")
    write_record(record, [str(header)])
    assert is_current(record)
    if change == "edited":
        header.write_text("int b;")
    else:
        header.unlink()
    assert not is_current(record)


@pytest.mark.parametrize("text", [None, "", "{", '{"a": '])
def test_a_missing_or_damaged_record_is_not_current(tmp_path, text):
    record = tmp_path / "record"
    if text is not None:
        record.write_text(text)
    assert not is_current(record)
