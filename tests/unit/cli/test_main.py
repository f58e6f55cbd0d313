"""The command line: exit statuses, messages, JSON; nothing that flies."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.base.errors import (
    CapabilityError,
    ComponentError,
    EstimateError,
    LinkSilent,
    ModelError,
    Refused,
    UsageError,
)
from volery.cli.command import BAD_INPUT, FAILED, LEFT_OUT, OK, exit_status
from volery.cli.commands.first_steps import PARTS, InstallablePart, doctor, example, module, program
from volery.cli.console import CommandOutput
from volery.cli.main import application
from volery.cli.run_display import next_folder


def run(*arguments: str):
    return CliRunner().invoke(application(), list(arguments))


def text(result) -> str:
    """All that was said, without the folding of the terminal."""
    return " ".join(result.output.split())


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (ModelError("x"), BAD_INPUT),
        (UsageError("x"), BAD_INPUT),
        (EstimateError("x"), BAD_INPUT),
        (CapabilityError("x"), BAD_INPUT),
        (LinkSilent("x"), FAILED),
        (Refused("drone_1", "arm", "x"), FAILED),
        (ComponentError("central", "x"), FAILED),
        (KeyboardInterrupt(), FAILED),
        (ZeroDivisionError("x"), FAILED),
    ],
)
def test_what_a_command_raises_becomes_a_status_and_a_message(error, status, capsys):
    def command() -> int:
        raise error

    assert exit_status(CommandOutput(quiet=True), command) == status
    said = capsys.readouterr()
    assert said.err.startswith("volery: ")
    assert "Traceback" not in said.err
    assert not said.out


def test_debug_shows_where(capsys):
    assert exit_status(CommandOutput(debug=True), lambda: 1 // 0) == FAILED
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_help_is_quick_to_import():
    """The commands import what they call when they are called."""
    heavy = ("numba", "jinja2", "pydantic", "pymavlink", "rosbags", "shapely", "numpy", "matplotlib")
    listing = f"print([name for name in {heavy} if name in sys.modules])"
    script = f"import sys; from volery.cli.main import application; application(); {listing}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("word", "imported"),
    [
        ("fly", {"fly"}),
        ("ros", {"ros", "ros_deploy"}),
        ("cost", {"cost", "cost_calibrate"}),
        ("doctor", None),
        ("--help", None),
    ],
)
def test_a_command_imports_the_files_of_its_first_word_only(word, imported):
    package = "volery.cli.commands."
    script = (
        f"import sys; from volery.cli.main import application; application({word!r}); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    found = {name.removeprefix(package) for name in done.stdout.split() if name.startswith(package)}
    assert found == imported or (imported is None and {"fly", "ros", "simulate"} < found)


@pytest.mark.parametrize(("stated", "found"), [(None, "1 1"), ("2", "2")])
def test_numpy_has_one_thread_unless_more_are_stated(stated, found):
    """Its threads wait for work as long as its import takes; results would depend on the number of cores."""
    script = """
import os, sys
from volery.cli.main import main
sys.argv = ["volery", "--version"]
try:
    main()
except SystemExit:
    import numpy
    print(os.environ["OPENBLAS_NUM_THREADS"], len(os.listdir("/proc/self/task")))
"""
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    environment |= {"OPENBLAS_NUM_THREADS": stated} if stated else {}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.splitlines()[-1].startswith(found)


def test_no_garbage_is_sought_when_a_command_ends():
    script = """
import atexit, gc, sys
from volery.cli.main import main
atexit.register(lambda: print(gc.get_freeze_count() > 1000))
sys.argv = ["volery", "--version"]
main()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True"


@pytest.mark.parametrize(
    "arguments", [("nonsense",), ("simulate",), ("simulate", "x", "--nonsense"), ("fly", "x.py")]
)
def test_wrong_words_are_bad_input(arguments):
    assert run(*arguments).exit_code == BAD_INPUT


def test_version():
    assert run("--version").output.startswith("volery")


def test_a_missing_model_is_bad_input(tmp_path):
    result = run("model", "check", str(tmp_path / "nothing.yaml"))
    assert result.exit_code == BAD_INPUT
    assert "there is no file" in text(result)


def test_a_spoilt_model_is_reported_with_its_line(tmp_path):
    folder = tmp_path / "model"
    assert run("new", str(folder)).exit_code == OK
    file = folder / "model.yaml"
    file.write_text(file.read_text().replace("carried_by: drone_1", "carried_by: drone_7"))
    result = run("model", "check", str(folder))
    line = next(n for n, line in enumerate(file.read_text().splitlines(), 1) if "drone_7" in line)
    assert result.exit_code == BAD_INPUT
    assert f"model.yaml:{line}: platform.processors.onboard.carried_by: no vehicle named 'drone_7'" in text(
        result
    )


def test_a_right_model_is_shown(tmp_path):
    result = run("model", "check", str(example("starter")))
    assert result.exit_code == OK
    assert "field-patrol is a valid model allocations: fast and slow scenarios: windy" in text(result)
    assert "ready for fidelity times" in text(result)
    assert "ready for fidelity code" in text(result)


def test_a_check_can_be_asked_for_as_json(tmp_path):
    result = run(
        "model",
        "check",
        str(example("starter")),
        "--format",
        "json",
        "--set",
        "platform.processors.onboard.frequency=1 GHz",
    )
    found = json.loads(result.stdout)
    assert found["allocations"] == ["fast", "slow"]
    assert found["missing"] == {"times": [], "code": []}
    assert found["findings"] == []


def test_a_check_gives_sarif_that_names_rule_file_and_line(tmp_path):
    folder = tmp_path / "model"
    assert run("new", str(folder)).exit_code == OK
    file = folder / "model.yaml"
    file.write_text(file.read_text().replace("carried_by: drone_1", "carried_by: drone_7"))
    result = run("model", "check", str(folder), "--format", "sarif")
    assert result.exit_code == BAD_INPUT
    log = json.loads(result.stdout)
    assert log["version"] == "2.1.0"
    (one, *_) = log["runs"][0]["results"]
    assert one["ruleId"] == "V201"
    place = one["locations"][0]["physicalLocation"]
    line = next(n for n, line in enumerate(file.read_text().splitlines(), 1) if "drone_7" in line)
    assert place == {"artifactLocation": {"uri": file.as_posix()}, "region": {"startLine": line}}
    assert [rule["id"] for rule in log["runs"][0]["tool"]["driver"]["rules"]] == ["V201"]


def test_a_uml_file_is_checked_with_its_own_lines(tmp_path):
    folder = tmp_path / "model"
    assert run("new", str(folder)).exit_code == OK
    assert run("model", "export", str(folder), "--to", str(folder / "starter.uml")).exit_code == OK
    assert run("model", "check", str(folder / "starter.uml")).exit_code == OK
    file = folder / "starter.uml"
    spoilt = file.read_text().replace("$path=components/patrol.py;", "$path=components/patrl.py;")
    assert spoilt != file.read_text()
    file.write_text(spoilt)
    component = 'name="Patrol" isActive'
    line = next(n for n, one in enumerate(spoilt.splitlines(), 1) if component in one)
    result = run("model", "check", str(file))
    assert result.exit_code == OK
    assert f"starter.uml:{line}: components.Patrol.path: there is no file" in text(result)
    simulated = run("simulate", str(file))
    assert simulated.exit_code == BAD_INPUT
    assert f"volery model import {file} --out model.yaml" in text(simulated)


def test_a_model_without_its_code_is_analysed_drawn_shown_compared_and_exported(tmp_path):
    folder = tmp_path / "model"
    assert run("new", str(folder)).exit_code == OK
    for file in (folder / "components").iterdir():
        file.unlink()
    for words in (
        ("check",), ("analyse",), ("draw", "--to", str(tmp_path / "pictures")), ("show",),
        ("diff", str(folder)), ("export", "--to", str(tmp_path / "m.uml")),
        ("export", "--allow-loss", "--to", str(tmp_path / "m.aadl")),
    ):  # fmt: skip
        result = run("model", words[0], str(folder), *words[1:])
        assert result.exit_code == OK, (words, text(result))
    result = run("simulate", str(folder), "--fidelity", "times")
    assert result.exit_code == BAD_INPUT
    assert "2 things are wrong" in text(result)
    assert "a run needs its code. Write it, or remove `path` to run with the times" in text(result)
    model = folder / "model.yaml"
    model.write_text("".join(one for one in model.open() if "path: components" not in one))
    result = run(
        "simulate", str(folder), "--fidelity", "times", "--set", "run.duration=1 s", "--record", "none"
    )
    assert "a run needs" not in text(result)


@pytest.mark.parametrize("name", ["delivery", "starter"])
def test_a_model_goes_to_another_folder_as_uml_and_comes_back(tmp_path, name):
    files, back = tmp_path / "uml", tmp_path / "back"
    files.mkdir()
    back.mkdir()
    uml = files / "m.uml"
    assert run("model", "export", str(example(name)), "--to", str(uml)).exit_code == OK
    made = run("model", "import", str(uml), "--out", str(back / "model.yaml"))
    assert "which `files_from` allows now" in text(made)
    result = run("model", "check", str(back))
    assert result.exit_code == OK, text(result)
    assert "no file" not in text(result)
    compared = run("model", "diff", str(example(name)), str(back))
    assert compared.exit_code == OK, text(compared)


def test_what_is_left_out_is_a_status_of_its_own(tmp_path):
    aadl = ("model", "export", str(example("starter")), "--to", str(tmp_path / "m.aadl"))
    assert run(*aadl).exit_code == LEFT_OUT
    assert run(*aadl, "--allow-loss").exit_code == OK
    assert run("model", "export", str(example("starter")), "--to", str(tmp_path / "m.uml")).exit_code == OK
    text = (tmp_path / "m.uml").read_text()
    unknown = '<x:Y xmlns:x="x" base_Class="_model"/></xmi:XMI>'
    (tmp_path / "m.uml").write_text(text.replace("</xmi:XMI>", unknown))
    back = ("model", "import", str(tmp_path / "m.uml"), "--out", str(tmp_path / "m.yaml"), "--replace")
    assert run(*back).exit_code == LEFT_OUT
    assert run(*back, "--allow-loss").exit_code == OK


def test_an_import_says_what_it_made_and_what_did_not_map(tmp_path):
    file = tmp_path / "empty.uml"
    file.write_text("<a/>")
    result = run("model", "import", str(file), "--out", str(tmp_path / "m.yaml"))
    assert (result.exit_code, "there is no uml:Model in it" in text(result)) == (BAD_INPUT, True)
    uml = tmp_path / "starter.uml"
    assert run("model", "export", str(example("starter")), "--to", str(uml), "--quiet").output == ""
    result = run("model", "import", str(uml), "--out", str(tmp_path / "m.yaml"), "--json")
    made = json.loads(result.stdout)
    assert made["model"] == str(tmp_path / "m.yaml")
    [note] = made["notes"]
    assert "which `files_from` allows now" in note
    result = run("model", "import", str(uml), "--processor", "x=y", "--out", str(tmp_path / "n.yaml"))
    assert "--processor x=y: NAME=KIND is expected; the kinds are generic-host" in text(result)


def test_an_unknown_format_of_a_check_is_named():
    result = run("model", "check", str(example("starter")), "--format", "xml")
    assert result.exit_code == BAD_INPUT
    assert "--format xml: give json, sarif or text" in text(result)


def test_an_option_that_is_wrong_is_named():
    result = run(
        "model", "check", str(example("starter")), "--set", "platform.processors.onboard.frequency=9 GHz"
    )
    assert result.exit_code == BAD_INPUT
    assert "--set platform.processors.onboard.frequency=9 GHz: " in text(result)


def test_quiet_says_nothing():
    result = run("model", "check", str(example("starter")), "--quiet")
    assert (result.exit_code, result.output) == (OK, "")


def test_the_schema_is_printed_whole():
    assert json.loads(run("model", "schema").stdout)["title"] == "volery system model"


def test_the_observables_are_listed():
    assert "<vehicle>.landing_offset" in text(run("model", "observables"))
    quantities = json.loads(run("model", "observables", "--json").stdout)
    assert {"subject", "quantity", "unit", "description"} == set(quantities[0])


def test_new_does_not_write_over_anything(tmp_path):
    (tmp_path / "mine.txt").touch()
    result = run("new", str(tmp_path))
    assert result.exit_code == BAD_INPUT
    assert "is not an empty folder" in text(result)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--fidelity", "hardware"), "not there yet"),
        (("--fidelity", "guess"), "no fidelity 'guess'"),
        (("--speed", "fast"), "--speed fast: give max, or simulated seconds per second"),
        (("--speed", "0"), "--speed 0"),
        (("--allocation", "quick"), "no allocation named 'quick'"),
        (("--scenario", "storm"), "no scenario named 'storm'"),
        (("--set", "nonsense"), "a path and a value are expected"),
        (("--out", "/dev/null/x"), "cannot write"),
    ],
)
def test_simulate_refuses_what_makes_no_sense(arguments, complaint):
    result = run("simulate", str(example("starter")), *arguments)
    assert result.exit_code == BAD_INPUT, result.output
    assert complaint in text(result)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("pixhawk",), "autopilot named 'pixhawk'"),
        (("--speed", "0"), "--speed 0"),
        (("--home", "1,2"), "home='1,2' should be 3 numbers"),
        (("--home", "100,2,3"), "latitude 100.0 is off the globe"),
        (("--kind", "boat"), "kind='boat'"),
        (("--listen", "serial:///dev/x"), "one listens at tcp://HOST:PORT"),
    ],
)
def test_serve_refuses_what_makes_no_sense(arguments, complaint):
    result = run("vehicle", "serve", *arguments)
    assert result.exit_code == BAD_INPUT, result.output
    assert complaint in text(result)


def test_report_of_a_folder_without_a_run(tmp_path):
    assert run("runs", "report", str(tmp_path)).exit_code == BAD_INPUT


def test_run_folders_are_counted_up(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert next_folder("my model/x") == Path("runs/my-model-x-1")
    Path("runs/a-2").mkdir(parents=True)
    Path("runs/a-b-9").mkdir()
    assert next_folder("a") == Path("runs/a-3")
    assert next_folder("...") == Path("runs/run-1")


def test_an_example_that_is_not_there():
    with pytest.raises(UsageError, match="no example 'nothing'"):
        example("nothing")


def test_doctor_finds_what_is_needed_and_says_how_to_get_the_rest(capsys):
    assert doctor(CommandOutput()) == OK
    assert "every necessary part is installed" in capsys.readouterr().out
    assert all(part.get for part in PARTS)
    assert module("no_such_module_anywhere")() == ""
    assert program("no-such-program-anywhere", "sh")().endswith("sh")


def test_doctor_shows_programs_of_real_firmware_or_how_to_build_them(capsys, monkeypatch, tmp_path):
    copter = tmp_path / "copter"
    copter.write_text("")
    copter.chmod(0o755)
    monkeypatch.setenv("VOLERY_ARDUCOPTER", str(copter))
    monkeypatch.setenv("VOLERY_PX4", str(tmp_path / "nowhere"))
    assert doctor(CommandOutput()) == OK
    said = "".join(capsys.readouterr().out.split())
    assert f"✓arducopter{copter}" in said
    assert "·px4missing" in said
    assert "makepx4_sitl_default,thenVOLERY_PX4=" in said


def test_doctor_fails_if_something_needed_is_missing(monkeypatch, capsys):
    lost = InstallablePart("gyro", lambda: "", "everything", "pip install gyro", needed=True)
    monkeypatch.setattr("volery.cli.commands.first_steps.PARTS", (lost,))
    assert doctor(CommandOutput()) == FAILED
    said = capsys.readouterr().out
    assert "pip install gyro" in said
    assert "missing: gyro" in said


VOLERY = "import sys; from volery.cli.main import main; sys.argv[0] = 'volery'; main()"


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("simul", ["simulate"]),
        ("vehicle params ", ["get", "set", "save", "load", "diff"]),
        ("runs c", ["compare"]),
        ("cost ", ["profile", "validate", "calibrate"]),
        ("cost --cata", ["--catalogue"]),
        ("cost step.c --cata", ["--catalogue"]),
        ("ser", []),
    ],
)
def test_a_shell_completes_nouns_verbs_and_options(typed, offered):
    words = {"COMP_WORDS": f"volery {typed}", "COMP_CWORD": str(len(f"volery {typed}x".split()) - 1)}
    done = subprocess.run(
        [sys.executable, "-c", VOLERY],
        env={**os.environ, **words, "_VOLERY_COMPLETE": "complete_bash"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.split() == offered


def test_completion_is_installed_for_the_shell_of_the_user(tmp_path):
    # The shell is found among the parents; without a second command bash would not stay one.
    command = f'"$0" -c "{VOLERY}" --install-completion bash; exit $?'
    done = subprocess.run(
        ["bash", "-c", command, sys.executable],
        env={**os.environ, "HOME": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "volery.sh" in (tmp_path / ".bashrc").read_text()
    assert "_VOLERY_COMPLETE=complete_bash" in next(tmp_path.rglob("volery.sh")).read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("runs", "compar", "a", "b"), "No such command 'compar'. Did you mean 'compare'?"),
        (("cost", "profile.c"), "profile.c: there is no such file"),
        (("vehicle", "serv"), "Did you mean 'serve'?"),
    ],
)
def test_a_misspelt_verb_is_told_from_a_file(words, said):
    result = run(*words)
    assert result.exit_code == BAD_INPUT
    assert said in text(result)


def test_the_help_of_a_noun_shows_what_it_does_without_a_verb():
    shown = text(run("cost", "--help"))
    assert "--catalogue" in shown
    assert "calibrate" in shown
    assert text(run("cost")) == shown
