from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair


def text(words: str) -> Frame:
    return Frame("STATUSTEXT", {"severity": 6, "text": words}, 1, 1)


def test_frames_arrive_after_the_delay_in_order() -> None:
    kernel = VirtualKernel()
    ours, theirs = in_process_pair(kernel, 5 * MS, "radio")
    seen: list[tuple[int, str]] = []
    ours.receive(lambda frame: seen.append((kernel.now(), frame.fields["text"])))
    theirs.send(text("one"))
    theirs.send(text("two"))
    kernel.run(S)
    assert seen == [(5 * MS, "one"), (5 * MS, "two")]


def test_a_closed_end_neither_sends_nor_receives() -> None:
    kernel = VirtualKernel()
    ours, theirs = in_process_pair(kernel, name="radio")
    seen: list[Frame] = []
    ours.receive(seen.append)
    theirs.send(text("under way"))
    ours.close()
    kernel.run(S)
    assert seen == []
    assert ours.problem()
    assert not theirs.problem()


def test_a_field_that_does_not_fit_is_refused_where_it_is_sent() -> None:
    ours, _ = in_process_pair(VirtualKernel(), name="radio")
    with pytest.raises(UsageError, match="no field 'altitude'"):
        ours.send(Frame("HEARTBEAT", {"altitude": 1}, 1, 1))


def test_one_end_states_which_messages_it_uses() -> None:
    ours, theirs = in_process_pair(VirtualKernel(), name="radio")
    assert theirs.is_wanted("HEARTBEAT"), "all are, until the other end has stated them"
    ours.select(lambda name: name == "STATUSTEXT")
    assert theirs.is_wanted("STATUSTEXT")
    assert not theirs.is_wanted("HEARTBEAT")
    assert ours.is_wanted("HEARTBEAT"), "each end states its own"
