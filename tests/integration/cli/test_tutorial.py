"""The tutorial works as written: its files are saved, its commands executed, its outputs compared."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytestmark = pytest.mark.integration

ROOT = Path(__file__).parents[3]
TUTORIAL = ROOT / "docs" / "tutorial"
PAGES = ("install.md", "first-flight.md", "first-service.md")
WITHIN_S = 600

_FILE = re.compile(r"[Ss]ave this as `([^`]+)`:$")
_INSTALL = re.compile(r"(python3 -m venv|\. \.venv|pip install) *(.*)")


def blocks(page):
    """Return the last line before each block of code, its language and its text."""
    found, before, inside = [], "", None
    for line in (TUTORIAL / page).read_text(encoding="utf-8").splitlines():
        if not line.startswith("```"):
            if inside is not None:
                inside.append(line)
            else:
                before = line or before
        elif inside is None:
            language, inside = line[3:], []
        else:
            found.append((before, language, "\n".join(inside)))
            before, inside = "", None
    assert inside is None, f"{page}: a block is not closed"
    return found


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """Return a function that runs commands in one temporary folder, as a user's shell does."""
    folder = tmp_path_factory.mktemp("tutorial")
    programs = folder / "programs"
    programs.mkdir()
    program = programs / "volery"
    program.write_text(f"#!{sys.executable}\nfrom volery.cli.main import main\nmain()\n")
    program.chmod(0o755)
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"

    def run(commands):
        done = subprocess.run(
            ["bash", "-e", "-c", commands],
            cwd=folder,
            env={**os.environ, "PATH": path, "COLUMNS": "200"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=WITHIN_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        return " ".join(done.stdout.split())

    run.folder = folder
    return run


@pytest.mark.parametrize("page", PAGES)
def test_a_page_works_as_written(shell, page):
    output, seen = "", set()
    for before, language, text in blocks(page):
        seen.add(language)
        file = _FILE.search(before)
        if file:
            path = shell.folder / file[1]
            path.parent.mkdir(exist_ok=True)
            path.write_text(text + "\n", encoding="utf-8")
        elif language == "sh":
            commands = [line for line in text.splitlines() if not _INSTALL.match(line)]
            output = shell("\n".join(commands))
        else:
            assert language == "text", f"{page}: what is to be done with this?\n{text}"
            for line in text.splitlines():
                assert " ".join(line.split()) in output
    assert "sh" in seen


def test_what_is_installed_exists():
    """The package itself is installed by the tests of the distribution; here its names are checked."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    lines = [line for _, _, text in blocks("install.md") for line in text.splitlines()]
    installed = [found[2] for line in lines if (found := _INSTALL.match(line)) and "pip" in found[1]]
    assert installed == ['".[all]"', "."]
    assert "all" in extras


def test_the_pages_are_linked_where_a_user_starts():
    for start in (ROOT / "README.md", ROOT / "docs" / "index.md", ROOT / "mkdocs.yml"):
        text = start.read_text(encoding="utf-8")
        assert all(f"tutorial/{page}" in text for page in PAGES), start
