"""What is committed speaks of the project alone: no path of the machine that it was written on."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
HOMES = re.compile(rb"(?<![\w.~/}])/(?:home|Users|root)/\w+/")
"""An absolute path into somebody's home; the parts of longer paths and addresses do not count."""

OWN = str(REPOSITORY).encode()


def committed() -> list[Path]:
    if shutil.which("git") is None or not (REPOSITORY / ".git").exists():
        pytest.skip("not a clone")
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, text=True, check=True
    ).stdout
    return [REPOSITORY / name for name in listed.split("\0") if name]


def test_no_text_names_a_folder_of_the_machine_that_it_was_written_on():
    guilty = []
    for path in committed():
        if not path.is_file():
            continue
        text = path.read_bytes()
        if HOMES.search(text) or (len(REPOSITORY.parts) > 2 and OWN + b"/" in text):
            guilty.append(str(path.relative_to(REPOSITORY)))
    assert guilty == []
