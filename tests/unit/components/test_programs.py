"""A user's file becomes a running component: classes, scripts, what they import, and their mistakes."""

from __future__ import annotations

import random
import textwrap
from types import ModuleType

import pytest

from volery.base.errors import ComponentError, Location, ModelError, UsageError
from volery.base.time import MS, S
from volery.components import component_api
from volery.components.instance import Allocation, RunningInstance
from volery.components.loader import Loader
from volery.components.programs import StubProgram, load_class, load_function, load_program, neutral, start
from volery.components.virtual_stdlib import virtual_modules
from volery.cost.instrumentation import UNIFORM_COSTS, StepCounter
from volery.cost.pricing import CountedPricing
from volery.kernel.processor import Processor
from volery.kernel.virtual import VirtualKernel
from volery.trace.events import Activation, Charge, Failure, Milestone, Slice, Text


class Desk:
    """A folder of user's files and a kernel to run them on."""

    def __init__(self, folder, seed=1):
        self.folder = folder
        self.events = []
        self.kernel = VirtualKernel(self.events.append)
        self.processor = Processor(self.kernel, "onboard")
        self.seat = Allocation(self.processor, frequency_mhz=600.0, priority=1)
        self.log = []
        log = ModuleType("log")
        log.tell = self.log.append
        self.loader = Loader({**virtual_modules(self.kernel, seed), "log": log})
        self.failures = []

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
        return path

    def start(self, path, class_name="", name="user", **given):
        operations = given.pop("operations", ())
        instance = RunningInstance(self.kernel, name, given.pop("seat", self.seat), operations=operations)
        program = load_program(self.loader, name, path, class_name)
        start(instance, program, given, self.kernel.root, lambda *failure: self.failures.append(failure))
        return instance

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


def test_a_class_is_constructed_by_parameter_name_and_run(desk):
    path = desk.write(
        "greeter.py",
        """
        import time
        from log import tell

        class Greeter:
            def __init__(self, who, times=2):
                self.who, self.times = who, times

            def run(self):
                for _ in range(self.times):
                    time.sleep(0.5)
                    tell((self.who, time.monotonic()))
        """,
    )
    desk.start(path, "Greeter", who="world")
    desk.kernel.run(5 * S)
    assert desk.log == [("world", 0.5), ("world", 1.0)]
    assert len(desk.of(Activation)) == 3


def test_a_script_runs_as_main(desk):
    path = desk.write(
        "node.py",
        """
        import time
        from log import tell

        def main():
            time.sleep(1)
            tell(__name__)

        if __name__ == "__main__":
            main()
        """,
    )
    desk.start(path, seat=Allocation(priority=0))
    desk.kernel.run(5 * S)
    assert desk.log == ["__main__"]


def test_a_file_is_executed_once_an_instance_and_what_it_imports_once_a_run(desk):
    desk.write("pkg/__init__.py", "from .inner import Kind\n")
    desk.write("pkg/inner.py", "class Kind: pass\n")
    desk.write("shared.py", "from pkg import Kind\nseen = []\n")
    path = desk.write(
        "part.py",
        """
        from log import tell
        import pkg.inner
        import shared
        COUNT = 0

        class Part:
            def run(self):
                global COUNT
                COUNT += 1
                shared.seen.append(COUNT)
                tell((COUNT, len(shared.seen), shared.Kind is pkg.inner.Kind))
        """,
    )
    desk.start(path, "Part", "one")
    desk.start(path, "Part", "two")
    desk.kernel.run(S)
    assert desk.log == [(1, 1, True), (1, 2, True)]


def test_nothing_global_is_changed(desk):
    path = desk.write("part.py", "import random, time\nclass Part:\n    def run(self): random.seed(3)\n")
    random.seed(5)
    before = random.getstate()
    desk.start(path, "Part")
    desk.kernel.run(S)
    assert random.getstate() == before


GOOD = """
class Central:
    def __init__(self, routes, drones, limit=3):
        pass

    def order(self, good):
        pass
"""


def check(desk, text, given, operations=(), active=False):
    program = load_program(desk.loader, "central", desk.write("central.py", text), "Central")
    program.check(given, operations, active)


@pytest.mark.parametrize(
    ("given", "operations", "active", "line", "message"),
    [
        (
            ["route", "drones"],
            (),
            False,
            3,
            "Central: its constructor requires 'routes' (did you mean 'route'?), "
            "but the model gives drones or route",
        ),
        (
            ["routes", "drones", "limits"],
            (),
            False,
            3,
            "Central: the model gives 'limits' (did you mean 'limit'?), "
            "but its constructor takes drones, limit or routes",
        ),
        (
            ["routes", "drones"],
            ("orders",),
            False,
            2,
            "Central: has no method 'orders', an operation that it provides (did you mean 'order'?)",
        ),
        (["routes", "drones"], ("order",), True, 2, "Central: has no method 'run', but is active"),
    ],
)
def test_a_class_that_does_not_fit_is_refused_before_it_starts(
    desk, given, operations, active, line, message
):
    with pytest.raises(ModelError) as caught:
        check(desk, GOOD, given, operations, active)
    assert caught.value.where == Location(str(desk.folder / "central.py"), line)
    assert caught.value.what == message


@pytest.mark.parametrize(
    ("text", "given", "operations"),
    [
        (GOOD, ["routes", "drones"], ("order",)),
        (GOOD, ["routes", "drones", "limit"], ("order",)),
        ("class Central:\n    def __init__(self, **ports): pass\n", ["anything"], ()),
    ],
)
def test_a_class_that_fits_is_accepted(desk, text, given, operations):
    check(desk, text, given, operations)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (
            "class Centrale:\n    pass\n",
            1,
            "no class 'Central' (did you mean 'Centrale'?); there is Centrale",
        ),
        ("x = 1\n\ndef f(:\n", 3, "not Python: invalid syntax"),
        ("class Central: pass\nreturn 3\n", 2, "not Python: 'return' outside function"),
        ("Central = 3\nfrom os import path as Central\n", 1, "'Central' is not a class"),
    ],
)
def test_files_that_cannot_be_used(desk, text, line, message):
    with pytest.raises(ModelError) as caught:
        check(desk, text, [])
    assert caught.value.where == Location(str(desk.folder / "central.py"), line)
    assert caught.value.what == message


def test_a_missing_file_is_named_at_the_line_of_the_model(desk):
    with pytest.raises(ModelError, match=r"model.yaml:12: no file .*nowhere.py"):
        load_program(desk.loader, "x", desk.folder / "nowhere.py", "X", Location("model.yaml", 12))


def test_a_file_that_raises_on_loading_names_the_component(desk):
    with pytest.raises(ComponentError, match=r"central: .*central\.py cannot be loaded: ZeroDivisionError"):
        check(desk, "1 / 0\nclass Central: pass\n", [])


def test_a_script_has_no_ports(desk):
    program = load_program(desk.loader, "x", desk.write("x.py", "pass\n"), "")
    for given, operations, active in ((["drone"], (), True), ((), ("order",), True), ((), (), False)):
        with pytest.raises(ModelError, match="script"):
            program.check(given, operations, active)


def test_an_error_is_reported_with_its_source_line(desk):
    path = desk.write("bad.py", "class Bad:\n    def run(self):\n        raise KeyError('parcel')\n")
    desk.start(path, "Bad", "bad")
    desk.kernel.run(S)
    [(who, error)] = desk.failures
    assert who == "bad"
    assert str(error) == "bad: run raised KeyError: 'parcel' (bad.py:3)"
    assert [failure.who for failure in desk.of(Failure)] == ["bad"]


def test_api_calls_find_the_run_and_the_component(desk):
    path = desk.write(
        "user.py",
        """
        from volery.components.component_api import add_time, log, note, now, sleep

        class User:
            def run(self):
                sleep(0.25)
                add_time(0.03, at_mhz=1500)
                note("parcel", "p-1", "ordered", f"at {now():g}")
                add_time(0.01, energy=0.5)
                log("done", "warning")
        """,
    )
    desk.start(path, "User")
    desk.kernel.run(S)
    assert desk.of(Milestone) == [Milestone(325 * MS, "user", "parcel", "p-1", "ordered", "at 0.325")]
    assert desk.of(Text) == [Text(335 * MS, "user", 4, "done")]
    charges = [(charge.kind, charge.caller / MS, charge.energy) for charge in desk.of(Charge)]
    assert charges == [("stated", 75, 0.0), ("stated", 10, 0.5)]


def test_a_note_is_written_as_text_and_none_is_refused(desk):
    path = desk.write(
        "user.py",
        """
        from volery.components.component_api import note

        class User:
            def run(self):
                note("point", 3, "\\udc80", 0.5)
                note("point", 4, None)
        """,
    )
    desk.start(path, "User")
    desk.kernel.run(S)
    [(_, error)] = desk.failures
    assert "volery.note(): state is None; give a text" in str(error)
    assert desk.of(Milestone) == [Milestone(0, "user", "point", "3", "\\udc80", "0.5")]


def test_api_calls_outside_a_run_are_refused():
    with pytest.raises(UsageError, match="works in a component or a mission of a run only"):
        component_api.note("parcel", "p-1", "ordered")


def test_counted_code_is_charged_and_takes_its_time(tmp_path):
    desk = Desk(tmp_path)
    steps = StepCounter(UNIFORM_COSTS)
    loader = Loader(virtual_modules(desk.kernel, 1), steps)
    path = desk.write(
        "loop.py",
        """
        import time

        class Loop:
            def run(self):
                for _ in range(2):
                    total = 0
                    for number in range(100):
                        total += number
                    time.sleep(1)
        """,
    )
    instance = RunningInstance(desk.kernel, "loop", desk.seat, CountedPricing(1000.0), read_steps=steps.take)
    program = load_program(loader, "loop", path, "Loop")
    start(instance, program, {}, desk.kernel.root, lambda *failure: desk.failures.append(failure))
    desk.kernel.run(10 * S)
    instance.flush_charges()
    slices = desk.of(Slice)
    assert desk.failures == []
    assert sum(ran.end - ran.start for ran in slices) == sum(charge.caller for charge in desk.of(Charge))
    assert (
        slices[0].end - slices[0].start == slices[1].end - slices[1].start + 1000 * 5
    )  # the first: run, for, range(2)
    assert {charge.kind for charge in desk.of(Charge)} == {"code"}


def test_a_stub_returns_neutral_values():
    kernel = VirtualKernel()
    stub = StubProgram(
        kernel, {"route": "Position[]", "name": "str", "ready": "bool", "order": "Receipt"}
    ).make({})
    assert (stub.route(1, 2), stub.name(), stub.ready(), stub.order(good="x")) == ([], "", False, None)
    assert (neutral("int"), neutral(""), neutral("float")) == (0, None, 0.0)


def test_an_active_stub_is_released_each_period(desk):
    instance = RunningInstance(desk.kernel, "stub", desk.seat)
    program = StubProgram(desk.kernel, {}, 100 * MS)
    start(instance, program, {}, desk.kernel.root, print)
    desk.kernel.run(250 * MS)
    assert [activation.released / MS for activation in desk.of(Activation)] == [0, 100, 200]


def test_functions_and_classes_of_a_file(desk):
    path = desk.write("mission.py", "def mission(drone):\n    return drone\n\nclass Kind: pass\n")
    assert load_function(desk.loader, path, "mission")(7) == 7
    assert load_class(path, "Kind").__name__ == "Kind"
    with pytest.raises(ModelError, match="no function 'missions'; there is mission"):
        load_function(desk.loader, path, "missions")


def test_printed_text_goes_to_the_trace_and_not_to_standard_output(desk, capsys):
    path = desk.write(
        "user.py",
        """
        import sys

        class User:
            def run(self):
                print("to", "people", sep=" ")
                print()
                print("elsewhere", file=sys.stdout)
        """,
    )
    desk.start(path, "User")
    desk.kernel.run(S)
    assert desk.of(Text) == [Text(0, "user", 6, "to people")]
    assert capsys.readouterr() == ("elsewhere\n", "to people\n\n")


def test_an_error_is_placed_in_the_users_file_and_libraries_are_noted(desk):
    path = desk.write(
        "user.py",
        "import json, math\nimport networkx\nclass User:\n    def run(self):\n        json.loads('{')\n",
    )
    desk.start(path, "User")
    desk.kernel.run(S)
    assert str(desk.failures[0][1]).endswith("(user.py:5)")
    assert desk.loader.libraries == {"json", "networkx"}


def test_packages_import_as_they_do_elsewhere(desk):
    desk.write("pkg/__init__.py", "")
    desk.write("pkg/one.py", "from . import two\nfrom .two import NAME\nfrom .sub import three\n")
    desk.write("pkg/two.py", "NAME = 'two'\n__all__ = ['NAME']\n")
    desk.write("pkg/sub/__init__.py", "")
    desk.write("pkg/sub/three.py", "from ..two import NAME as OTHER\nfrom .. import two\n")
    path = desk.write(
        "user.py",
        """
        import pkg.sub.three as three
        from log import tell
        from pkg import one
        from pkg.two import *
        import pkg.two

        class User:
            def run(self):
                tell((NAME, one.two is three.two is pkg.two, one.three is three, three.OTHER))
        """,
    )
    desk.start(path, "User")
    desk.kernel.run(S)
    assert desk.log == [("two", True, True, "two")]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("from pkg import nothing", "no module|cannot import|has no attribute 'nothing'"),
        ("from .absent import x", "no module .absent"),
        ("from threading import Barrier", "threading.Barrier is not available in the files of components"),
        (
            "from asyncio import open_connection",
            "asyncio.open_connection is not available in the files of components",
        ),
        ("import nowhere_to_be_found", "No module named 'nowhere_to_be_found'"),
    ],
)
def test_failed_imports_state_the_reason(desk, line, words):
    desk.write("pkg/__init__.py", "")
    path = desk.write("user.py", f"{line}\nclass User: pass\n")
    with pytest.raises(ComponentError, match=words):
        desk.start(path, "User")


@pytest.mark.parametrize("late", [False, True], ids=["on time", "late for ever"])
def test_a_component_that_sleeps_only_when_there_is_time_left_misses_each_cycle(desk, late):
    path = desk.write(
        "hold.py",
        """
        import volery

        class Hold:
            def __init__(self, work):
                self.work = work

            def run(self):
                due = volery.now()
                for _ in range(10):
                    volery.add_time(self.work)
                    due += 0.05
                    rest = due - volery.now()
                    if rest > 0:
                        volery.sleep(rest)
        """,
    )
    seat = Allocation(desk.processor, 600.0, 1, deadline=50 * MS, period=50 * MS)
    desk.start(path, "Hold", seat=seat, work=0.146 if late else 0.020)
    desk.kernel.run(5 * S)
    found = desk.of(Activation)
    assert len([one for one in found if one.finished > one.deadline]) == (10 if late else 0)
    responses = sorted((one.finished - one.released) / MS for one in found)
    assert responses[-10:] == ([146.0, *[242.0] * 5, *[338.0] * 4] if late else [20.0] * 10)


def test_asyncio_and_pools_of_threads_run_in_virtual_time(desk):
    path = desk.write(
        "user.py",
        """
        import asyncio
        import time
        from concurrent.futures import ThreadPoolExecutor, as_completed, wait
        from log import tell

        async def after(seconds):
            await asyncio.sleep(seconds)
            return seconds

        async def main():
            begun = time.monotonic()
            tell(await asyncio.gather(after(0.3), after(0.2)))
            try:
                await asyncio.wait_for(after(5), timeout=0.1)
            except asyncio.TimeoutError:
                tell("late")
            await asyncio.to_thread(time.sleep, 0.5)
            tell(round(time.monotonic() - begun, 3))
            turns = 0
            while time.monotonic() < begun + 1.0:  # asks without waiting
                await asyncio.sleep(0)
                turns += 1
            tell(turns > 1)

        def work(seconds):
            time.sleep(seconds)
            return seconds

        class User:
            def run(self):
                asyncio.run(main())
                with ThreadPoolExecutor(max_workers=2) as pool:
                    futures = [pool.submit(work, each) for each in (0.3, 0.1, 0.1)]
                    tell([one.result() for one in as_completed(futures)])
                    tell(list(pool.map(work, (0.2, 0.1))))
                    done, left = wait([pool.submit(work, 1), pool.submit(work, 3)], timeout=2)
                    tell((len(done), len(left)))
                    tell(type(pool.submit(work, -1).exception()).__name__)
        """,
    )
    desk.start(path, "User")
    desk.start(path, "User", "other")
    desk.kernel.run(20 * S)
    expected = [[0.3, 0.2], "late", 0.9, True, [0.1, 0.1, 0.3], [0.2, 0.1], (1, 1), "ValueError"]
    assert sorted(map(str, desk.log)) == sorted(map(str, expected * 2))
