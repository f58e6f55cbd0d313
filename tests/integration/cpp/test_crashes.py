"""Components that no program survives: the run does, names the component, and leaves a whole trace."""

from __future__ import annotations

import os

import pytest

from volery import Options, ProcessRunSession
from volery.base.errors import ComponentError, ModelError, UsageError
from volery.base.time import S
from volery.components.cpp import compiler
from volery.run import supervision
from volery.trace.events import Failure, Text
from volery.trace.reader import read

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: crash
components:
  Crash:
    language: roscpp
    path: crash.cpp
    active: true
    at: {{processor: intel-i5-3470, frequency: 3000 MHz}}
    activation: {{time: 1 us}}
  Other:
    language: python
    path: other.py
    active: true
    at: {{processor: intel-i5-3470, frequency: 3000 MHz}}
    activation: {{time: 1 us}}
application:
  crash: {{is: Crash, parameters: {{how: {how}}}}}
  other: {{is: Other}}
platform: {{processors: {{pc: {{is: intel-i5-3470, frequency: 3000 MHz}}}}}}
allocations: {{only: {{crash: pc, other: pc}}}}
requirements:
  failures: {{observe: crash.failures, max: 0}}
run: {{duration: 6 s}}
"""
OTHER = """
import volery

class Other:
    def run(self):
        for second in range(6):
            volery.log(f"at {second}")
            volery.sleep(1.0)
"""
WAYS = {
    "segmentation fault": "segmentation fault at address 0, in main (crash.cpp:24)",
    "throw": "main() raised std::out_of_range: nothing there",
    "loop": "virtual time is frozen: it computes and makes no request any more, in main (crash.cpp:26)",
    "recursion": "its stack is full: it recurses without end, or keeps too much in local variables",
    "abort": "aborted: abort(), a failed assertion or an exception that nothing catches",
    "status": "ended with exit status 3",
}


@pytest.mark.parametrize("how", WAYS)
def test_a_crash_names_the_component_and_leaves_a_complete_trace(run_model, monkeypatch, how):
    monkeypatch.setattr(supervision, "PATIENCE_S", 1.0)
    outcome = run_model(MODEL.format(how=how), "crash.cpp", other=OTHER)
    assert isinstance(outcome.run.error, ComponentError)
    assert outcome.run.error.component == "crash"
    assert WAYS[how] in str(outcome.run.error)
    assert outcome.run.record.outcome.status == "failed"
    assert outcome.run.record.outcome.requirements_met is False
    assert outcome.trace.complete
    [failure] = outcome.of(Failure)
    assert failure.who == "crash"
    texts = [one.text for one in outcome.of(Text)]
    assert texts[:3] == ["at 0", "at 1", "at 2"]
    assert (outcome.run.folder / "report.html").exists()


def test_a_crash_is_an_error_of_a_session_in_a_process_of_its_own(run_model, tmp_path):
    outcome = run_model(MODEL.format(how="abort"), "crash.cpp", other=OTHER)
    with ProcessRunSession(tmp_path, Options("times", out=tmp_path / "session")) as session:
        run = session.run()
    assert isinstance(run.error, ComponentError)
    assert run.error.component == "crash"
    assert f"{WAYS['abort']} after 0:00:0" in str(run.error)
    assert run.record.outcome.status == outcome.run.record.outcome.status == "failed"
    assert [one.at for one in read(tmp_path / "session" / "trace.mcap").events if isinstance(one, Text)] == [
        one.at for one in outcome.of(Text)
    ]


def test_a_program_that_fails_starts_again(run_model):
    model = MODEL.replace("6 s", "9 s").replace(
        "path: crash.cpp", "path: crash.cpp\n    on_failure: {{action: restart, max: 1, delay: 500 ms}}"
    )
    outcome = run_model(model.format(how="status"), "crash.cpp", other=OTHER)
    assert outcome.run.record.outcome.status == "failed"
    assert outcome.trace.complete
    failures = [(one.at // S, one.what) for one in outcome.of(Failure)]
    assert failures == [(at, "ended with exit status 3") for at in (3, 7)]
    said = [(one.at // S, one.text) for one in outcome.of(Text) if one.source == "crash"]
    assert [at for at, text in said if text == "and now: status"] == [2, 6]


def test_printed_text_goes_into_the_trace(run_model):
    outcome = run_model(MODEL.format(how="not"), "crash.cpp", other=OTHER)
    assert outcome.run.ok
    assert ("crash", "and now: not") in [(one.source, one.text) for one in outcome.of(Text)]


def test_a_compiler_error_names_the_source_line(run_model, tmp_path):
    said = "ros::MessageEvent<int>().getPublisherName()"
    (tmp_path / "crash.cpp").write_text(f"#include <ros/ros.h>\nint main() {{\n    {said};\n}}\n")
    with pytest.raises(ModelError) as caught:
        run_model(MODEL.format(how="not"), other=OTHER)
    assert caught.value.path == "Crash"
    assert caught.value.where is not None
    assert caught.value.where.file.endswith("crash.cpp")
    assert caught.value.where.line == 3
    assert "getPublisherName is not offered" in str(caught.value)

    unused = "#include <cv_bridge/cv_bridge.h>\n#include <nodelet/nodelet.h>\n"
    for line, words in (
        (
            "cv_bridge::CvImage image;",
            "<cv_bridge/cv_bridge.h> is not offered: read sensor_msgs::Image::data",
        ),
        (
            "#include <move_base_msgs/None.h>",
            "source the workspace of package move_base_msgs (ROS_PACKAGE_PATH)",
        ),
    ):
        (tmp_path / "crash.cpp").write_text(f"{unused}{line}\nint main() {{}}\n")
        with pytest.raises(ModelError) as caught:
            run_model(MODEL.format(how="not"), other=OTHER)
        assert caught.value.where is not None
        assert caught.value.where.line == 3
        assert words in str(caught.value)
        assert len(str(caught.value).splitlines()) <= 6


def test_no_compiler(run_model, monkeypatch):
    compiler.compiler.cache_clear()
    monkeypatch.setenv("PATH", os.devnull)
    try:
        with pytest.raises(UsageError, match=r"need a compiler.*apt install g\+\+"):
            run_model(MODEL.format(how="not"), "crash.cpp", fidelity="code", other=OTHER)
        outcome = run_model(MODEL.format(how="not"), "crash.cpp", other=OTHER)
        assert outcome.run.ok
        assert any("no C++ compiler" in one.text for one in outcome.of(Text) if one.source == "volery")
    finally:
        compiler.compiler.cache_clear()
