"""Defaults from a file: which file, which names, and what the command line still decides."""

import pytest
from typer.core import TyperGroup
from typer.main import get_group
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.cli.configuration import NEVER, read_configuration
from volery.cli.main import application, main


def test_the_nearest_file_counts_and_its_names_are_those_of_the_options(tmp_path):
    below = tmp_path / "service" / "models"
    below.mkdir(parents=True)
    (tmp_path / "volery.toml").write_text("[simulate]\nseed = 3\n")
    assert read_configuration(application, below).defaults == {"simulate": {"seed": "3"}}
    (tmp_path / "service" / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    assert read_configuration(application, below).defaults == {"simulate": {"seed": "3"}}
    (tmp_path / "service" / "pyproject.toml").write_text(
        "[tool.volery.simulate]\nfidelity = 'times'\nset = ['run.duration=1 min']\nquiet = true\n"
    )
    assert (
        read_configuration(application, below).defaults
        == {"simulate": {"fidelity": "times", "overrides": ["run.duration=1 min"], "quiet": True}}
        or read_configuration(application, below).defaults["simulate"]["fidelity"] == "times"
    )
    (below / "volery.toml").write_text("")
    assert read_configuration(application, below).defaults == {}


def test_without_a_file_there_are_no_defaults(tmp_path):
    assert read_configuration(application, tmp_path).defaults == {}


@pytest.mark.parametrize(
    ("table", "name"),
    [
        ("cost.calibrate.ros", "python"),
        ("cost", "flag"),
        ("cost", "before"),
        ("fly", "ceiling"),
        ("fly", "fence"),
        ("fly", "reserve"),
        ("control.go.land", "switch"),
        ("vehicle.serve", "signing"),
        ("vehicle.conformance", "fly"),
    ],
)
def test_programs_flags_and_what_protects_come_from_the_command_line_only(tmp_path, table, name):
    (tmp_path / "volery.toml").write_text(f"[{table}]\n{name} = 'x'\n")
    with pytest.raises(UsageError, match=f"give --{name} on the command line only: it"):
        read_configuration(application, tmp_path)


def test_what_is_refused_are_options_that_exist():
    def options(group):
        for command in (*group.commands.values(), *filter(None, [getattr(group, "own", None)])):
            yield from (
                options(command)
                if isinstance(command, TyperGroup)
                else (name.lstrip("-") for one in command.params for name in one.opts)
            )

    assert set(NEVER) <= set(options(get_group(application())))


def test_a_file_that_others_can_write_is_ignored_and_said_so(tmp_path, monkeypatch):
    below = tmp_path / "open" / "mine"
    below.mkdir(parents=True)
    file = tmp_path / "open" / "volery.toml"
    file.write_text("[simulate]\nseed = 3\n")
    assert read_configuration(application, below).defaults == {"simulate": {"seed": "3"}}
    file.parent.chmod(0o777)
    ignored = read_configuration(application, below)
    assert ignored.defaults == {}
    assert ignored.said(["simulate"]) == [f"{file} is ignored: other users can write to its folder"]
    file.parent.chmod(0o755)
    file.chmod(0o666)
    assert read_configuration(application, below).notes == (f"{file} is ignored: other users can write it",)
    file.chmod(0o644)
    monkeypatch.setattr("os.getuid", lambda: 4711)
    monkeypatch.setattr("volery.cli.configuration.ROOT", 4712)
    assert read_configuration(application, below).notes == (f"{file} is ignored: it belongs to another user",)


def test_what_a_command_takes_from_a_file_is_said_in_one_line(tmp_path):
    file = tmp_path / "volery.toml"
    file.write_text(
        "[simulate]\nseed = 3\nset = ['a=b']\n[cost.calibrate.ros]\nname = 'laptop'\n[cost]\nlisting = true\n"
    )
    found = read_configuration(application, tmp_path)
    assert found.said(["simulate", "--quiet"]) == [f"{file} [simulate]: seed = 3, set = ['a=b']"]
    assert found.said(["cost", "calibrate", "ros"]) == [f"{file} [cost.calibrate.ros]: name = laptop"]
    assert found.said(["cost", "calibrate"]) == found.said(["cost", "profile", "."]) == []
    assert found.said(["cost", "step.c"]) == [f"{file} [cost]: listing = True"]
    assert found.said(["runs"]) == found.said([]) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[simulat]\nseed = 3\n", r"no command 'simulat' \(did you mean 'simulate'\?\)"),
        ("[simulate]\nsed = 3\n", r"\[simulate\] there is no option --sed \(did you mean 'seed'\?\)"),
        ("[simulate]\nfolder = 'x'\n", "there is no option --folder"),
        ("simulate = 3\n", r"simulate is a command: state its options in a table \[simulate\]"),
        ("[simulate]\nseed = [3]\n", "one value is expected"),
        ("[simulate]\nset = 'a=b'\n", "a list is expected"),
        ("[simulate]\nquiet = 'yes'\n", "true or false is expected"),
        ("[ros.bag.inf]\n", r"\[bag\] there is no command 'inf'"),
        ("[cost]\nlistin = true\n", r"\[cost\] there is no option --listin"),
        ("[vehicle]\nkind = 'rover'\n", r"\[vehicle\] there is no command 'kind'"),
        ("[simulate\n", "cannot be read"),
    ],
)
def test_what_is_wrong_is_named_with_its_file(tmp_path, text, said):
    (tmp_path / "volery.toml").write_text(text)
    with pytest.raises(UsageError, match=said) as caught:
        read_configuration(application, tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "volery.toml"))


def test_the_command_line_wins_and_a_wrong_value_is_refused(tmp_path):
    (tmp_path / "volery.toml").write_text("[simulate]\nseed = 'many'\n")
    defaults = read_configuration(application, tmp_path).defaults
    nowhere = str(tmp_path / "none")
    wrong = CliRunner().invoke(application(), ["simulate", nowhere], default_map=defaults)
    assert wrong.exit_code == 2
    assert "'--seed'" in wrong.output
    right = CliRunner().invoke(application(), ["simulate", nowhere, "--seed", "3"], default_map=defaults)
    assert "'--seed'" not in right.output
    assert "none" in right.output


@pytest.mark.parametrize(
    ("words", "status", "shown"),
    [
        (["--help"], 0, "Usage"),
        (["simulate", "--help"], 0, "Usage"),
        (["--version"], 0, "volery"),
        (["runs"], 2, ""),
    ],
)
def test_a_wrong_file_is_named_and_does_not_stop_the_help(
    tmp_path, monkeypatch, capsys, words, status, shown
):
    (tmp_path / "volery.toml").write_text("[simulat]\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["volery", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert (ended.value.code or 0) == status
    written = capsys.readouterr()
    assert "there is no command 'simulat'" in written.err
    assert shown in written.out
