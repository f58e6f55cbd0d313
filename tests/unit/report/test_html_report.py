"""The documents of a run folder: from the trace alone, whole or cut, in one file, safe, small."""

import base64
import hashlib
import json
import re
from html import unescape
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console, RenderableType

from volery.base.errors import UsageError
from volery.base.time import S
from volery.report.comparison_page import Comparison, read_side
from volery.report.html_report import (
    SCRIPTS,
    HtmlReport,
    environment,
    gather,
    recover,
    render,
)
from volery.report.terminal import comparison_table, cost_table, short_comparison, summary_table
from volery.requirements.accounts import Accounts, Circumstances
from volery.requirements.record import RunRecord, read_record, write_record
from volery.testing.sample_run import sample_events, sample_scenery, sample_setup
from volery.trace.attachments import RunSetup, VehicleSetup, to_json
from volery.trace.events import Charge, Event, Failure, Message, Milestone, Text, VehicleState
from volery.trace.mcap_writer import Attachment, McapWriter

_MAP = Attachment("world.json", "application/json", to_json(sample_scenery()))


def make_run(folder: Path, megahertz: float = 1500.0, seconds: float = 120.0) -> RunRecord:
    """A finished run folder, but for its report."""
    folder.mkdir()
    setup = sample_setup(onboard_mhz=megahertz)
    accounts = Accounts(setup)
    writer = McapWriter(folder / "trace.mcap", setup, [_MAP], lambda name: "string data\n")
    for event in sample_events(seconds=seconds, onboard_mhz=megahertz):
        accounts(event)
        writer(event)
    writer.outcome("completed", "")
    writer.close()
    record = accounts.record("completed", circumstances=Circumstances(2.0, {"volery": "0.1"}))
    write_record(record, folder)
    return record


def small_run(folder: Path, *events: Event, setup: RunSetup | None = None) -> Path:
    folder.mkdir()
    writer = McapWriter(folder / "trace.mcap", setup or RunSetup())
    for event in events:
        writer(event)
    writer.close()
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The sample run at two frequencies."""
    base = tmp_path_factory.mktemp("runs")
    make_run(base / "one")
    make_run(base / "two", 600.0)
    return base / "one", base / "two"


class _Tags(HTMLParser):
    """Collects what a document refers to, and checks that elements are closed in order."""

    void = frozenset({"meta", "link", "input", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.scripts: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.void:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append(dict(attrs))
        self.references += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(html: str) -> _Tags:
    tags = _Tags()
    tags.feed(html)
    assert tags.open == []
    return tags


def embedded(html: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    data: dict[str, object] = json.loads(found.group(1))
    return data


def shown(thing: RenderableType, width: int = 200) -> str:
    console = Console(width=width, file=StringIO(), record=True)
    console.print(thing)
    return console.export_text()


def test_one_file_that_asks_nothing_of_the_network(runs: tuple[Path, Path]) -> None:
    html = recover(runs[0]).report.read_text()
    tags = parsed(html)
    assert tags.references == ["data:,"]
    assert "http://" not in html
    assert "https://" not in html
    assert "@import" not in html
    assert "url(" not in html


def test_says_what_was_asked_of_it(runs: tuple[Path, Path]) -> None:
    html = render(gather(runs[1]))
    for words in (
        "hospital-delivery",
        "1 of 3 requirements not met",
        "drone_control is a Python node charged with figures of roscpp",
        "operating system and ROS master",
        "Arm: Battery below minimum",
        "rpi4-cortex-a72",
        "parcel_1",
        "on rover_north",
    ):
        assert words in html
    data = embedded(html)
    assert data["end"] == pytest.approx(120.0, abs=0.2)
    assert len(data["vehicles"]) == 4


def test_a_run_of_fifteen_minutes_stays_small(tmp_path: Path) -> None:
    make_run(tmp_path / "long", seconds=900.0)
    assert recover(tmp_path / "long").report.stat().st_size < 5_000_000


def test_words_of_others_cannot_break_out_of_the_page(tmp_path: Path) -> None:
    evil = "</script><script>alert(1)</script><img src=x>"
    folder = small_run(
        tmp_path / "evil",
        Text(0, evil, 3, evil),
        Failure(1, evil, evil),
        Milestone(2, evil, "parcel", evil, evil, evil),
        setup=RunSetup(system=evil, warnings=(evil,), not_counted=(evil,)),
    )
    html = render(gather(folder))
    tags = parsed(html)
    assert len(tags.scripts) == len(SCRIPTS) + 1  # and the data
    assert tags.references == ["data:,"]


def test_an_empty_run_still_has_a_report(tmp_path: Path) -> None:
    html = render(gather(small_run(tmp_path / "empty")))
    parsed(html)
    assert "A run" in html
    assert 'id="map"' not in html


def test_a_vehicle_without_a_map(tmp_path: Path) -> None:
    still = VehicleState(S, "d", *[0.0] * 3, 1.0, *[0.0] * 6, *[float("nan")] * 5, 1.0, False, "HOLD")
    html = render(gather(small_run(tmp_path / "bare", still)))
    assert 'id="map"' in html
    assert embedded(html)["scenery"] is None


def test_a_real_vehicle_of_unknown_truth(tmp_path: Path) -> None:
    lost = VehicleState(0, "d", *[float("nan")] * 13, 0.5, *[float("nan")] * 2, True, "GUIDED")
    events = [
        lost,
        *(lost._replace(at=n * S, estimated_x=2.0 * n, estimated_y=0.0, estimated_z=5.0) for n in (1, 2, 3)),
    ]
    folder = small_run(tmp_path / "real", *events)
    html = render(gather(folder))
    (vehicle,) = embedded(html)["vehicles"]
    assert vehicle["x"] == [2.0, 6.0]
    assert vehicle["speed"] == {"t": [], "v": []}
    recover(folder)
    assert read_record(folder).vehicles["d"].distance_m == 4.0


@pytest.mark.parametrize("left", [0, 40])
def test_a_record_that_a_full_disk_has_cut_off_is_made_again(tmp_path: Path, left: int) -> None:
    still = VehicleState(0, "d", *[0.0] * 3, 1.0, *[0.0] * 6, *[0.0] * 3, 1.0, 12.0, 1.0, True, "GUIDED")
    folder = small_run(tmp_path / "cut", still)
    recover(folder)
    record = folder / "run.json"
    whole = record.read_bytes()
    for spoilt in (whole[:left], b"[" * 100_000):
        record.write_bytes(spoilt)
        recover(folder)
        assert record.read_bytes() == whole


def test_a_parcel_is_drawn_with_the_vehicle_of_the_component_that_has_it(tmp_path: Path) -> None:
    still = VehicleState(
        0, "rover_7", *[0.0] * 3, 1.0, *[0.0] * 6, *[0.0] * 3, 1.0, 12.0, 1.0, True, "GUIDED"
    )
    folder = small_run(
        tmp_path / "carried",
        still,
        Message(0, 1, "/rover_7/mavros/state", "rover_7/mavros", "driver", 10),
        Message(0, 1, "/rover_7/mavros/state", "rover_7/mavros", "watcher", 10),
        still._replace(vehicle="rover_8"),
        Message(0, 1, "/rover_8/mavros/state", "rover_8/mavros", "watcher", 10),
        Milestone(1, "central", "parcel", "p", "to_port", "driver"),
        Milestone(2, "central", "parcel", "p", "seen", "watcher"),
        Milestone(3, "central", "parcel", "p", "on rover_8", "driver"),
    )
    (kind,) = embedded(render(gather(folder)))["notes"]
    (parcel,) = kind["subjects"]
    assert [step["vehicle"] for step in parcel["steps"]] == ["rover_7", "", "rover_8"]


def test_a_parcel_is_in_the_store_then_where_it_is_said_to_be(tmp_path: Path) -> None:
    folder = tmp_path / "placed"
    folder.mkdir()
    writer = McapWriter(folder / "trace.mcap", RunSetup(), [_MAP])
    for at, state, detail in (
        (0, "ordered", "blood for san_rafael"),
        (1, "planned", "blood for san_rafael"),
        (2, "at port_north", ""),
        (3, "delivered", "san_rafael"),
    ):
        writer(Milestone(at, "central", "parcel", "p", state, detail))
    writer.close()
    (kind,) = embedded(render(gather(folder)))["notes"]
    (parcel,) = kind["subjects"]
    assert [step["place"] for step in parcel["steps"]] == ["store", "", "port_north", "san_rafael"]


def test_kinds_of_notes_have_sections_of_their_own_that_stay_bounded(tmp_path: Path) -> None:
    toggling = [
        Milestone(n, "porter", "door", "gate", f"{'open' if n % 2 else 'shut'}", "") for n in range(500)
    ]
    seen = [Milestone(n, "camera", "survey point", f"point_{n}", "seen", "") for n in range(70)]
    html = render(
        gather(small_run(tmp_path / "kinds", *toggling, *seen, Milestone(9, "a", "box", "b", "x", "")))
    )
    for words in ("<h2>Doors", "<h2>Survey points", "<h2>Boxes", "10 more stand in run.json", "70 of 70"):
        assert words in html
    doors, points, _ = embedded(html)["notes"]
    assert doors["subjects"][0]["steps"][0]["state"] == "shut"
    assert len(doors["subjects"][0]["steps"]) == 201
    assert (len(points["subjects"]), points["left_out"]) == (60, 10)


def test_a_noted_place_is_there_and_the_vehicle_of_who_noted_it_is_known(tmp_path: Path) -> None:
    folder = tmp_path / "inspected"
    folder.mkdir()
    writer = McapWriter(folder / "trace.mcap", RunSetup(vehicles=(VehicleSetup("drone_9"),)), [_MAP])
    writer(Message(0, 1, "/drone_9/mavros/state", "drone_9/mavros", "inspector", 10))
    writer(Milestone(1, "inspector", "place", "port_north", "inspected", "by drone_9"))
    writer(Milestone(2, "inspector", "crack", "c1", "found", ""))
    writer.close()
    places, cracks = (kind["subjects"][0]["steps"][0] for kind in embedded(render(gather(folder)))["notes"])
    assert (places["place"], places["from"]) == ("port_north", "drone_9")
    assert (cracks["place"], cracks["vehicle"], cracks["from"]) == ("", "", "drone_9")


def test_more_words_than_fit_are_counted(tmp_path: Path) -> None:
    html = render(gather(small_run(tmp_path / "talk", *(Text(n, "d", 6, f"line {n}") for n in range(1000)))))
    assert "600 more stand in the trace alone" in html


def test_a_report_made_while_the_run_is_in_progress_is_that_of_its_trace(tmp_path: Path) -> None:
    record = make_run(tmp_path / "run")
    live = HtmlReport(sample_setup(), [_MAP])
    for event in sample_events(seconds=120.0):
        if (listener := live.listener(type(event))) is not None:
            listener(event)
    written = live.write(record, tmp_path / "run").read_bytes()
    assert recover(tmp_path / "run").report.read_bytes() == written
    assert live.listener(Charge) is None


def test_a_killed_run_is_recovered_from_its_trace(runs: tuple[Path, Path], tmp_path: Path) -> None:
    whole = (runs[0] / "trace.mcap").read_bytes()
    (tmp_path / "trace.mcap").write_bytes(whole[: 2 * len(whole) // 3])
    found = recover(tmp_path)
    assert found.record.outcome.status == "unfinished"
    assert "never finished" in found.lost
    assert found.record.wall_s is None
    assert found.record.versions == {}
    assert found.record.requirements["control"].met is True  # judged by what is there
    assert found.record.components["drone_control"].processor == "onboard"
    assert read_record(tmp_path) == found.record
    assert "unfinished" in found.report.read_text()
    timeline = json.loads((tmp_path / "timeline.json").read_text())
    assert any(event["name"] == "drone_control" for event in timeline)


def test_where_there_is_nothing_to_recover_nothing_is_made(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"trace\.mcap"):
        recover(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_finished_run_that_lost_its_record(runs: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").write_bytes((runs[1] / "trace.mcap").read_bytes())
    found = recover(tmp_path)
    before = read_record(runs[1])
    assert found.lost == ""
    assert found.record.outcome == before.outcome
    assert found.record.components == before.components
    assert found.record.requirements == before.requirements


def test_a_record_that_is_there_is_kept(runs: tuple[Path, Path]) -> None:
    before = (runs[0] / "run.json").read_bytes()
    assert recover(runs[0]).record.wall_s == 2.0
    assert (runs[0] / "run.json").read_bytes() == before


def compared(*folders: Path) -> Comparison:
    return Comparison([read_side(folder) for folder in folders])


def test_runs_side_by_side(runs: tuple[Path, Path], tmp_path: Path) -> None:
    recover(runs[0])
    html = compared(*runs).write(tmp_path).read_text()
    tags = parsed(html)
    assert any(reference.endswith("one/report.html") for reference in tags.references)
    for words in ("fast", "slow", "1 500", "600", "✗ not met", "drone_control"):
        assert words in html.replace("\N{NO-BREAK SPACE}", " ")
    text = shown(comparison_table([read_record(folder) for folder in runs]))
    assert "deadline misses" in text


def test_one_run_cannot_be_compared(runs: tuple[Path, Path]) -> None:
    with pytest.raises(UsageError, match="at least two"):
        compared(runs[0])


def test_runs_of_the_same_allocation_go_by_their_folders(runs: tuple[Path, Path], tmp_path: Path) -> None:
    make_run(tmp_path / "again")
    assert "again" in compared(runs[0], tmp_path / "again").labels


def test_tables_for_the_terminal(runs: tuple[Path, Path]) -> None:
    records = [read_record(folder) for folder in runs]
    text = shown(summary_table(records[1]))
    for words in ("hospital-delivery", "not met", "drone_control", "not counted", "p95 ms", "60× real time"):
        assert words in text
    first = records[1].not_counted[0].split()[0]
    assert f"not counted: {first}" in shown(summary_table(records[1], notes=True))
    assert f"not counted: {first}" not in text
    assert "fast" in shown(comparison_table(records))
    assert "slow" in shown(short_comparison(records), 100)


def test_a_narrow_terminal_drops_columns_but_never_digits(runs: tuple[Path, Path]) -> None:
    record = read_record(runs[1])
    wide, narrow = shown(cost_table(record), 160), shown(cost_table(record), 90)
    misses = f"{record.components['drone_control'].deadline_misses:,}".replace(",", "\N{NO-BREAK SPACE}")
    assert "language" in wide
    assert "language" not in narrow
    for text in (wide, narrow):
        assert misses in text
        assert "drone_control" in text


def test_the_band_of_power_figures_is_shown_where_energy_is(tmp_path: Path) -> None:
    known = make_run(tmp_path / "run")

    def told(error: float | None) -> str:
        processors = {
            name: one.model_copy(update={"energy_error": error}) for name, one in known.processors.items()
        }
        return shown(summary_table(known.model_copy(update={"processors": processors})))

    assert "±" not in told(None)
    in_words = "±\N{NO-BREAK SPACE}20\N{NO-BREAK SPACE}%"
    assert told(0.2).count(in_words) == 1 + len(known.processors)  # the components' heading, each processor


def test_a_page_runs_its_own_scripts_only() -> None:
    made = environment()
    page = made.from_string(
        '{% extends "page.html.j2" %}{% block body %}{% for script in scripts %}<script>{{ script }}</script>'
        "{% endfor %}<script>alert(1)</script>{% endblock %}"
    ).render()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    allowed = unescape(policy[1])
    assert "default-src 'none'" in allowed
    assert "'unsafe-inline'" not in allowed.split("style-src")[0]
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    known = [
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() in allowed for script in scripts
    ]
    assert known == [*[True] * len(SCRIPTS), False]
