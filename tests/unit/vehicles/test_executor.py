"""The executor against a driver whose telemetry is written by the test: every outcome of a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from volery.base.errors import Failsafe, LinkLost, NotArrived, Overridden, Refused, VehicleError
from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.trace.events import Event, Text
from volery.vehicles.driver import Repeat, Step
from volery.vehicles.executor import MONITOR_PERIOD, StepExecutor
from volery.vehicles.telemetry import Answer, StatusText, Telemetry


@dataclass
class Driven:
    """What the executor uses of a driver."""

    telemetry: Telemetry
    name: str = "craft"
    cycle: Callable[[], None] | None = None
    offboard_mode: str = "GUIDED"
    wrong: str | None = None
    stopped: int = 0

    def problem(self) -> str | None:
        return self.wrong

    def stop(self) -> None:
        self.stopped += 1


@dataclass
class Rig:
    """An executor, its telemetry, and a vehicle that reports every 100 ms in GUIDED, armed and flying."""

    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.kernel = VirtualKernel(self.events.append)
        self.seen = Telemetry(self.kernel, "craft")
        self.seen.mode, self.seen.status, self.seen.armed, self.seen.flying = "GUIDED", "ACTIVE", True, True
        self.driver = Driven(self.seen)
        any_driver: Any = self.driver
        self.executor = StepExecutor(self.kernel, any_driver)
        self.executor.set_commanded("GUIDED")
        self.sent: list[float] = []
        self.silent = False
        self.reports = self.kernel.every(100 * MS, self.report)

    def report(self) -> None:
        if not self.silent:
            self.seen.note_message(self.kernel.now())
            self.seen.changed.notify()

    def step(self, **changes: Any) -> Step:
        wanted: dict[str, Any] = {"ask": "go", "send": self.send, "done": lambda _: False, "within": 10 * S}
        return Step(**{**wanted, **changes})

    def send(self) -> None:
        self.sent.append(to_seconds(self.kernel.now()))

    def at(self, seconds: float, action: Callable[[], object]) -> None:
        self.kernel.call_at(round(seconds * S), lambda: void(action()))

    def sets(self, seconds: float, **values: Any) -> None:
        self.at(seconds, lambda: [setattr(self.seen, name, value) for name, value in values.items()])

    def says(self, seconds: float, text: str, severity: int = 4) -> None:
        self.at(seconds, lambda: self.seen.texts.append(StatusText(self.kernel.now(), severity, text)))

    def answers(self, seconds: float, key: str, accepted: bool, result: str = "DENIED") -> None:
        answer = Answer(round(seconds * S), accepted, result)
        self.at(seconds, lambda: self.seen.answers.update({key: answer}))

    def run(self, script: Callable[[], object]) -> float:
        """Run the script; return when it ended, s. What it raises is raised here."""
        ended: list[float] = []
        raised: list[VehicleError] = []

        def body() -> None:
            try:
                script()
            except VehicleError as error:
                raised.append(error)
            ended.append(to_seconds(self.kernel.now()))
            self.reports.cancel()

        self.kernel.spawn(body, "script", ExecutionContext("script"))
        self.kernel.run(300 * S)
        if raised:
            raise raised[0]
        return ended[0]

    def execute(self, *steps: Step, **options: Any) -> float:
        return self.run(lambda: self.executor.execute("goto", lambda: steps, **options))


def void(_: object) -> None:
    pass


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.kernel.close()


# -- done, refused, late


def test_a_step_ends_at_the_message_that_shows_its_effect(rig: Rig) -> None:
    rig.sets(2.05, mode="LAND")
    assert rig.execute(rig.step(done=lambda seen: seen.mode == "LAND", enters="LAND")) == 2.1
    assert rig.sent == [0.0]
    assert rig.executor.commanded == "LAND"


def test_steps_follow_each_other_and_skippable_ones_that_are_done_are_not_sent(rig: Rig) -> None:
    asked: list[str] = []

    def named(name: str, *, done: bool, skippable: bool = False) -> Step:
        return rig.step(
            ask=name,
            send=lambda: asked.append(name),
            done=lambda _: done or name in asked,
            skippable=skippable,
        )

    rig.execute(
        named("first", done=False), named("skipped", done=True, skippable=True), named("sent", done=True)
    )
    assert asked == ["first", "sent"]


def test_a_skipped_step_takes_the_mode_as_commanded(rig: Rig) -> None:
    rig.seen.mode = "AUTO"
    rig.execute(rig.step(done=lambda _: True, skippable=True, enters="AUTO"))
    assert rig.sent == []
    assert rig.executor.is_ours()
    assert rig.executor.commanded == "AUTO"
    rig.seen.mode = "LOITER"
    assert not rig.executor.is_ours()


def test_a_command_is_repeated_until_it_is_answered(rig: Rig) -> None:
    rig.answers(2.5, "176", accepted=True)
    rig.sets(4.0, mode="LAND")
    rig.execute(rig.step(answer="176", again=S, done=lambda seen: seen.mode == "LAND", enters="LAND"))
    assert rig.sent == [0.0, 1.0, 2.0]


def test_a_command_without_an_answer_is_repeated_until_its_effect_is_seen(rig: Rig) -> None:
    rig.sets(2.5, mode="LAND")
    rig.execute(rig.step(again=S, done=lambda seen: seen.mode == "LAND", enters="LAND"))
    assert rig.sent == [0.0, 1.0, 2.0]


def test_the_refusal_of_a_command_quotes_the_text_that_follows(rig: Rig) -> None:
    rig.answers(1.0, "400", accepted=False)
    rig.says(1.3, "PreArm: compass")
    with pytest.raises(Refused, match=r"refused to go \(DENIED\): PreArm: compass; wait for a fix"):
        rig.execute(rig.step(answer="400", advice="wait for a fix"))
    assert 1500 * MS <= rig.kernel.now() < 2 * S


def test_a_refusal_quotes_notices_and_no_information(rig: Rig) -> None:
    rig.answers(1.0, "400", accepted=False)
    rig.says(1.1, "Mission: 3 WP", severity=6)
    rig.says(1.2, "Throttle not zero", severity=5)
    with pytest.raises(Refused, match=r"refused to go \(DENIED\): Throttle not zero$"):
        rig.execute(rig.step(answer="400"))


def test_a_refusal_without_a_text_says_so(rig: Rig) -> None:
    rig.answers(1.0, "400", accepted=False)
    with pytest.raises(Refused, match=r"gave no reason$"):
        rig.execute(rig.step(answer="400"))


def test_the_refusal_of_a_repeated_command_proves_nothing_until_it_is_late(rig: Rig) -> None:
    rig.answers(2.5, "400", accepted=False)
    rig.sets(4.0, mode="LAND")
    step = rig.step(answer="400", again=S, done=lambda seen: seen.mode == "LAND", enters="LAND")
    assert rig.execute(step) == pytest.approx(4.0, abs=0.11)


def test_the_refusal_of_a_repeated_command_is_the_error_when_it_is_late(rig: Rig) -> None:
    rig.answers(2.5, "400", accepted=False)
    with pytest.raises(Refused):
        rig.execute(rig.step(answer="400", again=S))
    assert rig.sent == [0.0, 1.0, 2.0]


def test_an_earlier_answer_does_not_count(rig: Rig) -> None:
    rig.seen.answers["400"] = Answer(0, False, "DENIED")
    rig.sets(1.0, mode="LAND")
    rig.execute(rig.step(answer="400", done=lambda seen: seen.mode == "LAND", enters="LAND"))


def test_a_late_step_says_what_is_seen_and_what_was_said(rig: Rig) -> None:
    rig.says(1.0, "EKF variance")
    expected = (
        "to go was not seen within 10 s; .*mode GUIDED, armed; the autopilot never answered; .*EKF variance"
    )
    with pytest.raises(NotArrived, match=expected):
        rig.execute(rig.step(answer="400"))
    assert rig.kernel.now() >= 10 * S


def test_a_step_without_an_answer_is_late_without_blaming_the_answer(rig: Rig) -> None:
    with pytest.raises(NotArrived) as raised:
        rig.execute(rig.step())
    assert "never answered" not in str(raised.value)


def test_a_step_that_can_no_longer_be_done_ends_at_once_with_its_own_error(rig: Rig) -> None:
    lost: list[str] = []
    rig.at(3.0, lambda: lost.append("the plan is gone"))
    with pytest.raises(LinkLost, match=r"the plan is gone; .*mode GUIDED, armed; send it again"):
        rig.execute(rig.step(fails=lambda: lost[0] if lost else "", failure=_Gone, advice="send it again"))
    assert rig.kernel.now() < 10 * S


class _Gone(LinkLost):
    def __init__(self, *parts: str) -> None:
        super().__init__(": ".join(parts))


def test_a_check_ends_a_step(rig: Rig) -> None:
    def check(asked: str, now: Ns) -> VehicleError | None:
        return NotArrived("craft", asked, "the fence") if now >= 2 * S else None

    with pytest.raises(NotArrived, match=r"goto.*the fence"):
        rig.execute(rig.step(), check=check)


def test_a_check_is_made_at_telemetry_five_times_a_second_at_most(rig: Rig) -> None:
    made: list[Ns] = []

    def check(_asked: str, now: Ns) -> None:
        made.append(now)

    for number in range(1, 100):
        rig.at(number * 0.03, rig.seen.changed.notify)
    rig.sets(3.0, mode="LAND")
    rig.execute(rig.step(done=lambda seen: seen.mode == "LAND", enters="LAND"), check=check)
    assert 13 <= len(made) <= 16
    assert all(later - earlier >= MONITOR_PERIOD for earlier, later in pairwise(made))


def test_what_is_to_be_kept_is_repeated_until_the_end(rig: Rig) -> None:
    kept: list[float] = []
    keep = Repeat(500 * MS, lambda: kept.append(to_seconds(rig.kernel.now())))
    rig.sets(2.2, mode="LAND")
    rig.execute(rig.step(keep=keep, done=lambda seen: seen.mode == "LAND", enters="LAND"))
    assert kept == [0.5, 1.0, 1.5, 2.0]


# -- others take over


def test_another_mode_in_flight_is_never_overridden(rig: Rig) -> None:
    rig.sets(2.0, mode="LOITER")
    with pytest.raises(
        Overridden, match=r"changed from GUIDED to LOITER \(status ACTIVE\).*switch the vehicle to GUIDED"
    ):
        rig.execute(rig.step(mode="GUIDED"))
    assert rig.driver.stopped == 1
    assert rig.executor.commanded == ""


def test_a_mode_that_the_autopilot_may_enter_by_itself_is_no_takeover(rig: Rig) -> None:
    rig.sets(2.0, mode="LOITER")
    rig.sets(4.0, mode="LAND")
    rig.execute(rig.step(enters="LAND", leads_to=("LOITER",), done=lambda seen: seen.mode == "LAND"))


def test_a_failsafe_is_named_with_its_cause(rig: Rig) -> None:
    rig.says(1.9, "Battery failsafe")
    rig.sets(2.0, mode="RTL", failsafe=True)
    with pytest.raises(
        Failsafe, match=r"changed from GUIDED to RTL.*failsafe \(battery\).*last said 'Battery failsafe'"
    ):
        rig.execute(rig.step(mode="GUIDED"))


def test_one_that_is_disarmed_meanwhile_was_taken(rig: Rig) -> None:
    rig.sets(2.0, armed=False)
    with pytest.raises(Overridden, match="was disarmed in GUIDED"):
        rig.execute(rig.step(armed=True, mode="GUIDED"))


def test_one_that_stays_armed_was_not_disarmed(rig: Rig) -> None:
    assert rig.execute(rig.step(armed=True, mode="GUIDED", done=lambda _: rig.kernel.now() > 2 * S)) > 2.0


def test_one_that_is_to_be_armed_yet_was_not_disarmed(rig: Rig) -> None:
    rig.seen.armed = rig.seen.flying = False
    rig.sets(2.0, armed=True)
    rig.execute(rig.step(armed=True, done=lambda seen: seen.armed))


def test_another_target_is_a_takeover(rig: Rig) -> None:
    rig.sets(3.0, target=None)
    with pytest.raises(Overridden, match="another target"):
        rig.execute(rig.step(lost=lambda: "another target" if rig.kernel.now() >= 2 * S else ""))


def test_a_sequence_that_is_undone_on_the_ground_starts_over(rig: Rig) -> None:
    rig.seen.flying = False
    rig.sets(1.0, mode="STABILIZE")
    rig.sets(1.2, mode="GUIDED")
    rig.sets(5.0, flying=True)
    rig.execute(rig.step(mode="GUIDED", done=lambda seen: seen.flying), restarts=3)
    assert len(rig.sent) == 2


def test_a_sequence_that_is_undone_too_often_says_how_often(rig: Rig) -> None:
    rig.seen.flying = False

    def swap() -> None:
        rig.seen.mode = "STABILIZE" if rig.seen.mode == "GUIDED" else "GUIDED"

    for tenth in range(1, 200):
        rig.at(tenth, swap)
    with pytest.raises(
        Overridden, match=r"changed from .* before lift-off, each time it was started over \(2 times\)"
    ):
        rig.execute(rig.step(mode="GUIDED", within=100 * S), restarts=2)
    assert len(rig.sent) == 3


def test_a_successor_aborts_the_step_and_those_after_it(rig: Rig) -> None:
    rig.at(2.0, lambda: rig.executor.abort_for("land()"))
    with pytest.raises(Overridden, match=r"goto.*land.. took its place"):
        rig.execute(rig.step(), rig.step(ask="never"))
    assert rig.sent == [0.0]
    assert rig.kernel.now() >= 2 * S


def test_a_successor_between_two_steps_aborts_the_second(rig: Rig) -> None:
    def first(seen: Telemetry) -> bool:
        if rig.sent:
            rig.executor._claim += 1
        return bool(rig.sent)

    with pytest.raises(Overridden):
        rig.execute(rig.step(done=first), rig.step(ask="second"))
    assert rig.sent == [0.0]


# -- control between operations


def test_the_mode_before_is_ours_until_the_new_one_is_seen(rig: Rig) -> None:
    rig.seen.mode = "AUTO"
    rig.executor.set_commanded("AUTO")
    rig.executor.set_commanded("LAND")
    assert rig.executor.is_ours()
    rig.executor.set_commanded("LAND")
    assert rig.executor.is_ours()
    rig.executor.release_control()
    assert not rig.executor.is_ours()


def test_a_foreign_mode_in_flight_is_refused_before_an_operation(rig: Rig) -> None:
    rig.seen.mode = "LOITER"
    with pytest.raises(
        Overridden, match=r"is in LOITER \(status ACTIVE\), which this program did not command; to hand"
    ):
        rig.executor.check_ours("goto")
    assert (rig.driver.stopped, rig.executor.commanded) == (1, "")


def test_a_failsafe_in_flight_is_refused_as_one(rig: Rig) -> None:
    rig.seen.mode, rig.seen.failsafe = "RTL", True
    with pytest.raises(Failsafe, match=r"failsafe \(not stated by the autopilot\)"):
        rig.executor.check_ours("goto")


def test_any_mode_on_the_ground_is_accepted_and_ends_the_loss_of_a_stream(rig: Rig) -> None:
    rig.seen.mode, rig.seen.flying, rig.seen.stream_lost = "STABILIZE", False, "no set-points"
    rig.executor.check_ours("takeoff")
    assert rig.seen.stream_lost == ""


def test_a_lost_stream_is_a_failsafe_that_an_order_of_safety_takes_back(rig: Rig) -> None:
    rig.seen.mode, rig.seen.stream_lost, rig.seen.failsafe = "RTL", "no set-points for 1 s", True
    with pytest.raises(Failsafe, match=r"no set-points for 1 s: the autopilot is in RTL.*resume"):
        rig.executor.check_ours("goto")
    assert rig.executor.take_back()
    assert rig.executor.is_ours()
    assert rig.seen.stream_lost == ""
    rig.sets(0.5, mode="GUIDED")
    rig.execute(rig.step(enters="GUIDED", done=lambda seen: seen.mode == "GUIDED"))


def test_the_offboard_mode_is_not_commanded_over_a_failsafe(rig: Rig) -> None:
    rig.seen.mode, rig.seen.failsafe = "RTL", True
    with pytest.raises(Failsafe, match="is in a failsafe, in RTL"):
        rig.execute(rig.step(enters="GUIDED"))
    assert rig.sent == []


@pytest.mark.parametrize(("lasts", "flying"), [(False, True), (True, False)])
def test_there_is_nothing_to_take_back(rig: Rig, lasts: bool, flying: bool) -> None:
    rig.seen.failsafe_lasts, rig.seen.flying = lasts, flying
    assert rig.executor.take_back() is False


# -- the link


def test_a_silent_vehicle_is_lost_after_the_time_out(rig: Rig) -> None:
    rig.driver.wrong = "connection refused"
    rig.sets(2.0)
    rig.at(2.05, lambda: setattr(rig, "silent", True))
    with pytest.raises(
        LinkLost,
        match=r"craft: goto: no message was received for 5.0 s; connection refused; last: .*at 2.0 s",
    ):
        rig.execute(rig.step(within=60 * S))
    assert rig.kernel.now() >= 7 * S


@pytest.mark.parametrize("to_safety", [False, True])
def test_only_an_order_of_safety_is_sent_on_a_lost_link(rig: Rig, to_safety: bool) -> None:
    rig.at(1.05, lambda: setattr(rig, "silent", True))

    def script() -> None:
        rig.kernel.sleep_until(8 * S)
        rig.executor.check_link("land", to_safety)

    if to_safety:
        assert rig.run(script) == 8.0
    else:
        with pytest.raises(LinkLost, match=r"land: no message was received for 7.0 s"):
            rig.run(script)


def test_after_a_silence_the_state_must_be_fresh(rig: Rig) -> None:
    rig.at(1.05, lambda: setattr(rig, "silent", True))
    rig.at(4.05, lambda: setattr(rig, "silent", False))

    def script() -> None:
        rig.kernel.sleep_until(5 * S)
        rig.executor.check_link("goto", to_safety=False)

    assert rig.run(script) == pytest.approx(6.1, abs=0.11)  # two seconds after the first message


def test_a_fresh_link_and_one_before_the_first_message_delay_nothing(rig: Rig) -> None:
    rig.executor.check_link("goto", to_safety=False)

    def script() -> None:
        rig.kernel.sleep_until(S)
        rig.executor.check_link("goto", to_safety=False)

    assert rig.run(script) == 1.0


def test_the_link_is_lost_at_its_time_out_and_not_before(rig: Rig) -> None:
    rig.reports.cancel()
    seen: list[bool] = []

    def look() -> None:
        seen.append(rig.executor.link_lost())

    rig.seen.note_message(0)
    for when in (4.999, 5.0):
        rig.at(when, look)
    rig.at(6.0, lambda: None)
    rig.kernel.run(10 * S)
    assert seen == [False, True]


# -- a node with a loop of its own


def test_a_cycle_is_spun_until_the_step_is_done(rig: Rig) -> None:
    cycles: list[float] = []

    def cycle() -> None:
        cycles.append(to_seconds(rig.kernel.now()))
        rig.kernel.sleep_until(rig.kernel.now() + 500 * MS)

    kept: list[float] = []
    rig.driver.cycle = cycle
    rig.sets(3.2, mode="LAND")
    keep = Repeat(S, lambda: kept.append(to_seconds(rig.kernel.now())))
    rig.execute(rig.step(again=S, keep=keep, enters="LAND", done=lambda seen: seen.mode == "LAND"))
    assert rig.sent == [0.0, 1.0, 2.0, 3.0]
    assert kept == [1.0, 2.0, 3.0]
    assert cycles == [0.5 * number for number in range(7)]


def test_a_cycle_waits_for_the_reason_of_a_refusal(rig: Rig) -> None:
    rig.driver.cycle = lambda: rig.kernel.sleep_until(rig.kernel.now() + 100 * MS)
    rig.answers(1.0, "400", accepted=False)
    rig.says(1.3, "PreArm: compass")
    with pytest.raises(Refused, match="PreArm: compass"):
        rig.execute(rig.step(answer="400"))


@pytest.mark.parametrize("spun", [False, True])
def test_a_wait_ends_with_its_condition_or_its_time(rig: Rig, spun: bool) -> None:
    if spun:
        rig.driver.cycle = lambda: rig.kernel.sleep_until(rig.kernel.now() + 100 * MS)
    found: list[bool] = []

    def script() -> None:
        found.append(rig.executor.wait(lambda: rig.kernel.now() >= 2 * S, 5 * S))
        found.append(rig.executor.wait(lambda: False, 3 * S))

    assert rig.run(script) == pytest.approx(5.0, abs=0.11)
    assert found == [True, False]


# -- what is said


def test_the_last_text_has_its_age_if_it_is_old(rig: Rig) -> None:
    assert rig.executor.last_text() == ""
    rig.says(0.5, "Vibration")
    rig.says(1.0, "Crash")
    texts: list[str] = []
    for when in (3.9, 4.5, 8.0):
        rig.at(when, lambda: texts.append(rig.executor.last_text()))
    rig.kernel.run(10 * S)
    assert texts == [f"; it last said 'Crash'{age}" for age in ("", " (4 s before)", " (7 s before)")]


def test_another_clock_is_reported_once(rig: Rig) -> None:
    rig.executor.report_clock(2.0)
    rig.executor.report_clock(3.0)
    assert [event.text[:44] for event in rig.events if isinstance(event, Text)] == [
        "its clock runs 2.0 times as fast as this com"
    ]
    assert [event.severity for event in rig.events if isinstance(event, Text)] == [5]  # a notice


def test_a_refusal_without_a_text_is_the_error_half_a_second_later(rig: Rig) -> None:
    rig.answers(1.0, "400", accepted=False)
    with pytest.raises(Refused):
        rig.execute(rig.step(answer="400"))
    assert rig.kernel.now() == pytest.approx(1.5 * S, abs=0.1 * S)


def test_a_cycle_is_not_spun_after_the_time(rig: Rig) -> None:
    cycles: list[Ns] = []

    def cycle() -> None:
        cycles.append(rig.kernel.now())
        rig.kernel.sleep_until(rig.kernel.now() + 100 * MS)

    rig.driver.cycle = cycle
    assert rig.run(lambda: rig.executor.wait(lambda: False, 300 * MS)) == 0.3
    assert len(cycles) == 3


def test_a_failsafe_on_the_ground_does_not_keep_the_offboard_mode_out(rig: Rig) -> None:
    rig.seen.mode, rig.seen.failsafe, rig.seen.flying, rig.seen.armed = "LAND", True, False, False
    rig.sets(1.0, mode="GUIDED")
    assert rig.execute(rig.step(enters="GUIDED", done=lambda seen: seen.mode == "GUIDED")) == 1.0
    assert rig.sent[0] == 0.0


@pytest.mark.parametrize(("armed_at", "ends"), [(3.0, 3.0), (9.0, 4.0)])
def test_what_a_signal_interrupted_is_waited_for_until_it_would_show(
    rig: Rig, armed_at: float, ends: float
) -> None:
    def interrupted() -> Step:
        raise KeyboardInterrupt

    rig.seen.armed = False
    rig.sets(armed_at, armed=True)

    def script() -> None:
        rig.kernel.sleep_until(S)
        with pytest.raises(KeyboardInterrupt):
            rig.executor.execute("arm", interrupted)  # type: ignore[arg-type]
        rig.kernel.sleep_until(2 * S)
        rig.executor.wait_for_interrupted()

    assert rig.run(script) == ends


def test_a_successor_aborts_at_once_and_not_at_the_next_message(rig: Rig) -> None:
    rig.at(1.25, lambda: rig.executor.abort_for("the operator"))
    ended: list[float] = []

    def script() -> None:
        with pytest.raises(Overridden):
            rig.executor.execute("goto", lambda: [rig.step()])
        ended.append(to_seconds(rig.kernel.now()))

    rig.run(script)
    assert ended == [1.25]


def test_a_step_that_is_spun_is_late_and_lost_as_another(rig: Rig) -> None:
    rig.driver.cycle = lambda: rig.kernel.sleep_until(rig.kernel.now() + 100 * MS)
    with pytest.raises(NotArrived, match="within 2 s"):
        rig.execute(rig.step(within=2 * S))
    assert rig.kernel.now() == pytest.approx(2 * S, abs=0.2 * S)


def test_a_failsafe_is_taken_back_once(rig: Rig) -> None:
    rig.seen.mode, rig.seen.failsafe, rig.seen.failsafe_lasts = "RTL", True, True
    done = rig.step(enters="GUIDED", done=lambda _: True)

    def script() -> None:
        assert rig.executor.take_back()
        rig.executor.execute("land", lambda: [done])
        rig.executor.execute("goto", lambda: [done])

    with pytest.raises(Failsafe, match=r"goto: .*is in a failsafe, in RTL"):
        rig.run(script)
    assert len(rig.sent) == 1
