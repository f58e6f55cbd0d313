"""Scripts and configuration files that were written before commands stood below nouns run unchanged."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from volery.base.errors import UsageError
from volery.cli.command import Noun
from volery.cli.configuration import read_configuration
from volery.cli.main import application, main
from volery.cli.old_names import MOVED, current_words

GOLDEN = Path(__file__).parents[2] / "golden" / "commands-of-0001042e.txt"
"""Each command of that commit with its arguments (* takes several) and options."""
OLD = dict(line.split(":") for line in GOLDEN.read_text(encoding="utf-8").splitlines())


def resolved(words):
    """The command that the words name."""
    command = get_command(application())
    for word in words:
        command = command.commands[word]
    return command.own if isinstance(command, Noun) and command.own else command


@pytest.mark.parametrize("old", OLD)
def test_each_old_command_has_its_arguments_and_options(old):
    words, remark = current_words(old.split())
    assert bool(remark) == (old.split()[0] in MOVED)
    params = resolved(words).params
    found = {name for one in params for name in (*one.opts, *one.secondary_opts) if name.startswith("-")}
    stated = OLD[old].split()
    assert {one for one in stated if one.startswith("-")} <= found
    arguments = [("*" * (one.nargs == -1) + one.name) for one in params if one.param_type_name == "argument"]
    if old in ("bridge", "model import"):  # they take what roslaunch adds, too
        assert any(one.startswith("*") for one in arguments)
    elif old != "report":  # several are `runs compare`
        assert [one for one in stated if not one.startswith("-")] == arguments


def test_old_names_are_in_no_help():
    top = get_command(application())
    assert not MOVED.keys() & top.commands.keys()
    assert len(top.commands) <= 14


def test_old_spellings_are_shown_nowhere():
    root = Path(__file__).parents[3]
    shown = re.compile(rf"(?<![\w/.-])volery ({'|'.join(MOVED)})(?![\w.=-])")
    texts = [root / "README.md", *(root / "docs").rglob("*.md"), *(root / "examples").rglob("*.md")]
    found = [
        f"{file.relative_to(root)}: {one[0]}"
        for file in (*texts, *(root / "src").rglob("*.py"))
        for one in shown.finditer(file.read_text(encoding="utf-8"))
    ]
    assert found == []


def said(monkeypatch, capsys, *words):
    """Exit status, standard output and standard error of a command line."""
    monkeypatch.setattr("sys.argv", ["volery", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    written = capsys.readouterr()
    return ended.value.code or 0, written.out, written.err


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("report fast --json", "runs report fast --json"),
        ("report fast slow", "runs compare fast slow"),
        ("report", "runs report"),
        ("runs . --json", "runs list . --json"),
        ("graph fast --json", "ros graph fast --json"),
        ("bag info fast/trace.mcap", "ros bag info fast/trace.mcap"),
        ("bag", "ros bag"),
        ("export-messages std_srvs --out .", "ros messages std_srvs --out ."),
        ("go rotation --on sim:ardupilot", "control go rotation --on sim:ardupilot"),
        ("response fast --step x", "control response fast --step x"),
        ("params get sim:dji X", "vehicle params get sim:dji X"),
        ("serve pixhawk", "vehicle serve pixhawk"),
        ("validate nowhere.yaml", "cost validate nowhere.yaml"),
        ("calibrate ros --help", "cost calibrate ros --help"),
    ],
)
def test_an_old_spelling_does_what_the_new_one_does(monkeypatch, capsys, tmp_path, make_run, old, new):
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "fast")
    make_run(tmp_path / "slow", 600.0)
    status, out, err = said(monkeypatch, capsys, *old.split())
    remark = current_words(old.split())[1]
    assert (status, out, err.removeprefix(f"{remark}\n" if remark else "")) == said(
        monkeypatch, capsys, *new.split()
    )
    assert not remark or err.startswith(f"{remark}\n")


def test_the_remark_is_one_line_on_standard_error_unless_quiet(monkeypatch, capsys, tmp_path, make_run):
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "fast")
    assert (
        "volery: `volery report` is now `volery runs report`\n"
        in said(monkeypatch, capsys, "report", "fast")[2]
    )
    assert "is now" not in said(monkeypatch, capsys, "report", "fast", "--quiet")[2]


def test_an_old_spelling_works_in_a_shell(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", "from volery.cli.main import main; main()", "serve", "pixhawk"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "volery: `volery serve` is now `volery vehicle serve`"


def test_tables_of_old_names_are_read(tmp_path):
    file = tmp_path / "volery.toml"
    file.write_text("[serve]\nspeed = 2\n[go.land]\nby = 'rc'\n[vehicle.params.get]\nkind = 'rover'\n")
    found = read_configuration(application, tmp_path)
    assert found.defaults["vehicle"] == {"serve": {"speed": "2"}, "params": {"get": {"kind": "rover"}}}
    assert found.defaults["control"] == {"go": {"land": {"by": "rc"}}}
    assert found.said(["vehicle", "serve"]) == [f"{file} [vehicle.serve]: speed = 2"]
    file.write_text("[serve]\nspeed = 2\n[vehicle.serve]\nspeed = 3\n")
    with pytest.raises(UsageError, match=r"\[serve\] and \[vehicle.serve\] are the same; keep \[vehicle"):
        read_configuration(application, tmp_path)
