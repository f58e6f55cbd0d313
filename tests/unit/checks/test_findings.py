"""Wrong models: each fault is found by its rule, in its line; nothing is found in models that are right."""

import json
import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from volery.checks.findings import check
from volery.checks.sarif import sarif
from volery.cli.commands.first_steps import example
from volery.model.rules import RULES
from volery.run.assembly.model_checks import vocabulary

WRONG = YAML(typ="safe").load(Path(__file__).with_name("wrong_models.yaml"))


def test_there_are_enough_wrong_models_for_every_rule():
    assert len(WRONG) >= 40
    tested = {one["rule"] for one in WRONG.values()}
    assert set(RULES) - tested == {"V701", "V703", "V901"}  # tested below, and in test_model_check


@pytest.mark.parametrize("case", WRONG, ids=lambda case: case.replace(" ", "-"))
def test_a_fault_is_found_named_and_located(bench, case):
    wrong = WRONG[case]
    code = wrong["rule"]
    if "text" in wrong:
        bench.file.write_text(wrong["text"])
    for change in wrong.get("changes", ()):
        bench.change(change["old"], change["new"], wrong.get("file", "model.yaml"))
    found = bench.check()
    matching = [one for one in found.findings if one.rule.code == code and wrong["says"] in str(one)]
    assert matching, [(one.rule.code, str(one)) for one in found.findings]
    where = matching[0].where
    if wrong["line"]:
        assert where is not None
        assert where.line == bench.line_of(wrong["line"], where.file.rpartition("/")[2]), where
    assert found.errors or RULES[code].level == "warning"


def test_nothing_is_wrong_with_the_model_itself(bench):
    found = bench.check()
    assert [str(one) for one in found.findings] == []
    assert found.system is not None
    assert found.system.instance("detector").memory_space == "vision"
    assert found.system.instance("detector").processor == "onboard"
    assert found.system.processor("onboard").operating_system == "debian"
    provenance = found.system.provenances["platform.processors.onboard.frequency"]
    assert (provenance.provenance, provenance.source) == ("required", "data sheet")
    assert [one.rule.code for one in found.missing["code"]] == ["V701"]


@pytest.mark.parametrize("name", ["starter", "cpp", "delivery"])
def test_nothing_is_wrong_with_the_examples(name):
    found = check(example(name) / "model.yaml", vocabulary())
    assert [str(one) for one in found.findings] == []


def test_a_warning_is_suppressed_with_its_reason(bench):
    bench.change("activation: {time: 12 ms}", "activation: {time: 500 ms}")
    bench.change("max: 80 ms", "max: 800 ms")
    at = "platform.processors.onboard"
    bench.change(
        "run: {", f"suppress: [{{rule: overload, at: {at}, reason: measured in the field}}]\nrun: {{"
    )
    found = bench.check()
    assert [str(one) for one in found.findings] == []
    ((one, reason),) = found.suppressed
    assert (one.rule.code, reason) == ("V405", "measured in the field")
    log = sarif(found, bench.file)
    (result,) = log["runs"][0]["results"]
    assert result["suppressions"] == [{"kind": "inSource", "justification": "measured in the field"}]
    json.dumps(log)


def test_a_folder_outside_can_be_allowed(bench):
    (bench.folder.parent / "shared").mkdir()
    (bench.folder / "code" / "pilot.py").rename(bench.folder.parent / "shared" / "pilot.py")
    bench.change("code/pilot.py", "../shared/pilot.py")
    bench.change("name: watch", "name: watch\nfiles_from: ../shared")
    assert [str(one) for one in bench.check().findings] == []


def test_a_symbolic_link_does_not_lead_out_of_the_folder(bench):
    outside = bench.folder.parent / "pilot.py"
    (bench.folder / "code" / "pilot.py").rename(outside)
    (bench.folder / "code" / "pilot.py").symlink_to(outside)
    assert [one.rule.code for one in bench.check().findings] == ["V110"]


def test_a_language_without_a_compiler_is_a_warning(bench, monkeypatch):
    (bench.folder / "code" / "pilot.cpp").write_text("int main() {}\n")
    bench.change("language: python\n    path: code/pilot.py", "language: c++\n    path: code/pilot.cpp")
    for module in ("volery.checks.system_rules", "volery.run.assembly.cpp"):
        monkeypatch.setattr(f"{module}.has_compiler", lambda: False)
    (one,) = bench.check().findings
    assert (one.rule.code, one.rule.level) == ("V703", "warning")
    assert "no C++ compiler is installed" in one.what


def test_several_faults_are_found_in_one_check(bench):
    bench.change("latency: 15 ms", "latncy: 15 ms")
    bench.change("{mode: Mode}", "{mode: Mood}")
    bench.change("{is: Map}", "{is: Mop}")
    assert {one.rule.code for one in bench.check().errors} == {"V103", "V208", "V201"}


def test_every_allocation_and_scenario_is_checked(bench):
    frequency = "platform.processors.onboard.frequency"
    bench.change("environment:", f"  slow: {{extends: all, set: {{{frequency}: 60 MHz}}}}\nenvironment:")
    bench.change("environment.wind: 0 m/s", "environment.wind: 0 kg")
    assert {(one.rule.code, one.where.line) for one in bench.check().errors} == {
        ("V403", bench.line_of("slow: {")),
        ("V106", bench.line_of("calm:")),
    }


def test_a_warning_of_every_variant_is_found_once(bench):
    bench.change("value: 1500 MHz", "value: 1450 MHz")
    assert [one.rule.code for one in bench.check().findings] == ["V404"]


def test_codes_and_names_of_rules_are_unique_and_stable_in_form():
    names = [one.name for one in RULES.values()]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"V[1-9]\d\d", code) for code in RULES)
    assert all(one.remedy and one.title for one in RULES.values())
