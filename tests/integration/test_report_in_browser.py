"""The report in a real browser: it draws, it plays, the slider moves the vehicles, a phone can read it."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigs.requirements import lacking
from volery.autonomy.map_server import path_message
from volery.base.time import S
from volery.report.comparison_page import Comparison, read_side
from volery.report.html_report import recover
from volery.requirements.accounts import Accounts
from volery.requirements.record import write_record
from volery.ros.messages import definition, new, to_cdr
from volery.testing.sample_run import sample_events, sample_scenery, sample_setup
from volery.trace.attachments import RunSetup, VehicleSetup, to_json
from volery.trace.events import Published, VehicleState
from volery.trace.mcap_writer import Attachment, McapWriter

pytestmark = pytest.mark.integration

_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if _CHROMIUM is None:
        lacking("no Chromium is installed (Debian: apt install chromium)")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        lacking("playwright is not installed (pip install playwright)")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=_CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    base = tmp_path_factory.mktemp("runs")
    made = []
    for megahertz in (1500.0, 600.0):
        folder = base / f"{megahertz:.0f}"
        folder.mkdir()
        setup = sample_setup(onboard_mhz=megahertz)
        accounts = Accounts(setup)
        world = Attachment("world.json", "application/json", to_json(sample_scenery()))
        writer = McapWriter(folder / "trace.mcap", setup, [world])
        for event in sample_events(onboard_mhz=megahertz):
            accounts(event)
            writer(event)
        writer.close()
        write_record(accounts.record("completed"), folder)
        recover(folder)
        made.append(folder)
    return made


@pytest.fixture
def open_page(browser: Any) -> Iterator[Any]:
    """Opens a document; at the end nothing may have gone wrong in it or have been asked of the network."""
    pages = []
    troubles: list[str] = []
    asked: list[str] = []

    def open_document(path: Path, width: int = 1280, height: int = 900, scheme: str = "light") -> Any:
        page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda line: troubles.append(line.text) if line.type == "error" else None)
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        pages.append(page)
        return page

    yield open_document
    for page in pages:
        page.close()
    assert troubles == []
    assert all(url.startswith(("file:", "data:")) for url in asked)


def picture(page: Any, selector: str) -> bytes:
    taken: bytes = page.locator(selector).screenshot()
    return taken


def colours(page: Any, selector: str) -> int:
    """How many different colours a canvas shows: an empty one has a single one."""
    count: int = page.evaluate(
        """(selector) => {
            const canvas = document.querySelector(selector);
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            const found = new Set();
            for (let at = 0; at < data.length; at += 4) {
                found.add(data[at] << 16 | data[at + 1] << 8 | data[at + 2]);
            }
            return found.size;
        }""",
        selector,
    )
    return count


def test_everything_is_drawn(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[1] / "report.html")
    for canvas in ("#map", "#height canvas", "#speed canvas", "#processors figure:nth-child(2) canvas"):
        assert colours(page, canvas) > 5, canvas
    assert page.locator("#vehicles li").count() == 4
    assert page.locator("#cost tbody tr").count() == 6
    assert page.locator("#requirements .bad").count() == 1
    assert page.locator(".lane .track i").count() > 8


def until(page: Any, holds: str) -> None:
    """Wait until an expression holds; ``wait_for_function`` compiles it in the page, which forbids it."""
    for _ in range(600):
        if page.evaluate(holds):
            return
        page.wait_for_timeout(50)
    raise AssertionError(holds)


def test_play_makes_time_pass_until_the_end(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[0] / "report.html")
    before = picture(page, "#map")
    page.evaluate("stage.now = 100")
    page.select_option("#rate", "120")
    page.click("#play")
    until(page, "stage.now > 130")
    assert page.locator("#play-sign").inner_text() != "▶"
    until(page, "stage.now >= stage.data.end")
    until(page, "document.getElementById('play-sign').textContent === '▶'")
    assert picture(page, "#map") != before


def test_the_slider_moves_the_vehicles_and_tells_the_time(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[0] / "report.html")
    card = page.locator("#vehicles li").first
    assert "disarmed" in card.inner_text()
    before = picture(page, "#map")
    page.locator("#time").fill("100")
    assert page.locator("#clock").inner_text() == "0:01:40.0"
    assert "30.0 m" in card.inner_text()
    assert "12.0 m/s" in card.inner_text()
    assert "on drone_1" in page.locator("#noted").inner_text()
    assert picture(page, "#map") != before
    page.locator("#time").press("ArrowRight")
    assert page.evaluate("stage.now") > 100


def test_what_rounds_to_zero_has_no_sign(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[0] / "report.html")
    shown = page.evaluate("[-0.04, 0.04, -0.06, -10].map(stage.tenths)")
    assert shown == ["0.0", "0.0", "-0.1", "-10.0"]


def test_a_vehicle_can_be_followed_and_the_map_zoomed(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[0] / "report.html")
    whole = picture(page, "#map")
    page.click("#vehicles button >> nth=0")
    assert page.locator("#vehicles li.followed").count() == 1
    near = picture(page, "#map")
    assert near != whole
    page.click("#zoom-in")
    assert picture(page, "#map") != near
    page.click("#zoom-fit")
    page.mouse.move(0, 0)
    assert page.locator("#vehicles li.followed").count() == 0


def test_a_click_into_a_chart_goes_there(open_page: Any, folders: list[Path]) -> None:
    page = open_page(folders[0] / "report.html")
    page.locator("#height canvas").click(position={"x": 250, "y": 100})
    assert 60 < page.evaluate("stage.now") < 240


@pytest.mark.parametrize("width", [390, 768, 1280])
def test_nothing_sticks_out_sideways(open_page: Any, folders: list[Path], width: int) -> None:
    for document in (
        folders[0] / "report.html",
        Comparison(list(map(read_side, folders))).write(folders[0].parent),
    ):
        page = open_page(document, width)
        assert page.evaluate("document.documentElement.scrollWidth") == width


def test_light_and_dark_differ(open_page: Any, folders: list[Path]) -> None:
    grounds = [
        open_page(folders[0] / "report.html", scheme=scheme).evaluate(
            "getComputedStyle(document.body).backgroundColor"
        )
        for scheme in ("light", "dark")
    ]
    assert grounds[0] != grounds[1]


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose nodes have published a map, a way, a plan, a scan and a picture."""
    folder = tmp_path_factory.mktemp("mapped")
    cells = np.zeros((60, 80), dtype=np.int8)
    cells[::59], cells[:, ::79], cells[:, :5] = 100, 100, -1
    grid = new("nav_msgs/msg/OccupancyGrid", header={"frame_id": "map"}, data=cells.ravel())
    grid.info.resolution, grid.info.width, grid.info.height = 0.5, 80, 60
    grid.info.origin.orientation.w = 1.0
    way = np.array([(second, 0.5 * second, 0.46) for second in range(1, 30)])
    scan = new("sensor_msgs/msg/LaserScan", angle_increment=0.1, range_max=9.0, ranges=[5.0] * 60)
    scan.header.stamp.sec = 29
    picture = new("sensor_msgs/msg/Image", height=8, width=8, step=8, encoding="mono8", data=range(0, 256, 4))
    messages = {
        "/map": grid,
        "/path": path_message(30 * S, way, times=[second * S for second in range(1, 30)]),
        "/plan": path_message(30 * S, way[::-1]),
        "/rover/scan": scan,
        "/rover/camera/image_raw": picture,
    }
    setup = RunSetup(vehicles=(VehicleSetup("rover", "ardupilot", "rover"),))
    writer = McapWriter(folder / "trace.mcap", setup, [], definition)
    for second in range(31):
        east, north, turn = float(second), 0.5 * second, (0.974, 0.0, 0.0, 0.228)
        still = (0.0,) * 6
        writer(
            VehicleState(second * S, "rover", east, north, 0.0, *turn, *still, 1.0, 12.0, 1.0, True, "AUTO")
        )
    for topic, message in messages.items():
        writer(Published(30 * S, topic, message.__msgtype__, "/slam", to_cdr(message)))
    writer.close()
    return recover(folder).report


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_map_that_a_node_has_published_can_be_chosen(open_page: Any, mapped: Path, scheme: str) -> None:
    page = open_page(mapped, scheme=scheme)
    with_map = picture(page, "#map")
    assert page.locator(".player + .legend span").count() == 4
    assert "/map at 0:00:30: map, within 0 cm of the track of rover" in page.content()
    assert colours(page, "canvas.picture") == 64
    page.select_option("#layer", label="none")
    without = picture(page, "#map")
    assert without != with_map
    page.select_option("#layer", label="/map")
    assert picture(page, "#map") == with_map
