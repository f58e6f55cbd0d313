"""Time that somebody else keeps."""

import threading

from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Rate, sleep
from volery.kernel.wall import FollowingKernel


def test_time_stands_still_until_it_is_advanced() -> None:
    kernel = FollowingKernel()
    happened: list[str] = []
    asleep, framework, over = threading.Event(), threading.Event(), threading.Event()

    def body() -> None:
        asleep.set()
        sleep(kernel, 5 * S)
        happened.append(f"woke at {kernel.now() // S}")
        over.set()

    def act() -> None:
        happened.append("framework")
        framework.set()

    with kernel.adopt("test"):
        kernel.spawn(body, "sleeper", ExecutionContext("sleeper"))
        kernel.call_at(3 * S, act)
        asleep.wait()
        assert kernel.now() == 0
        kernel.advance(2 * S)
        assert happened == []
        kernel.advance(2 * S)
        kernel.sleep_until(4 * S)
        kernel.advance(-S)  # never goes back
        assert kernel.now() == 4 * S
        framework.wait()
        kernel.advance(S)
        over.wait()
    assert happened == ["framework", "woke at 5"]
    assert kernel.close() == []


def test_a_jump_makes_a_rate_late_once() -> None:
    kernel = FollowingKernel()
    with kernel.adopt("test"):
        rate = Rate(kernel, S)
        kernel.advance(10 * S)
        rate.sleep()  # late by more than two periods: it begins anew
        threading.Timer(0, lambda: kernel.advance(S)).start()
        rate.sleep()
        assert kernel.now() == 11 * S
    assert kernel.close() == []
