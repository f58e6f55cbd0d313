"""Nothing is written through a link, and nothing but a regular file is read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from volery.base import files
from volery.base.errors import ModelError, UsageError
from volery.base.files import RecordFile, create_file, read_text, write_text
from volery.model.assembly import Selection, assemble
from volery.run.assembly.fences import read_fence
from volery.run.recording import make_folder


def test_text_is_written_over_what_was_there_and_read_back(tmp_path: Path) -> None:
    file = tmp_path / "text"
    write_text(file, "a longer text")
    write_text(file, "größer\r\n")
    assert file.read_bytes() == "größer\r\n".encode()
    assert read_text(file) == "größer\n"


@pytest.mark.parametrize("exists", [True, False])
def test_nothing_is_written_through_a_link(tmp_path: Path, exists: bool) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    if exists:
        target.write_text("precious")
    link.symlink_to(target)
    with pytest.raises(OSError, match="symbolic link"):
        create_file(link)
    with pytest.raises(UsageError, match="it is a symbolic link"):
        RecordFile(link)
    assert target.exists() == exists
    assert not exists or target.read_text() == "precious"


def test_the_probe_of_a_run_folder_does_not_empty_the_target_of_a_link(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("precious")
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / ".writable").symlink_to(target)
    with pytest.raises(UsageError, match="symbolic link"):
        make_folder(folder)
    assert target.read_text() == "precious"


@pytest.mark.timeout(30)
def test_a_fifo_a_device_and_a_huge_file_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fifo, zero, huge = tmp_path / "fifo", tmp_path / "zero", tmp_path / "huge"
    os.mkfifo(fifo)
    zero.symlink_to("/dev/zero")
    huge.write_text("x" * 101)
    monkeypatch.setattr(files, "MAX_TEXT", 100)
    for file in (fifo, zero, huge):
        with pytest.raises(OSError, match=r"no regular file|larger than"):
            read_text(file)
        with pytest.raises(ModelError, match=r"no regular file|larger than"):
            assemble(file, Selection())
        with pytest.raises(UsageError, match=r"no regular file|larger than"):
            read_fence(file)
    with pytest.raises(OSError, match="No such device"):  # no program reads the FIFO
        create_file(fifo)
