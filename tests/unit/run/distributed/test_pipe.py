"""Messages between the process of a run and a worker."""

from __future__ import annotations

import os

import pytest

from volery.base.position import AMSL, Position
from volery.run.distributed import pipe


def test_a_pipe_delivers_messages_in_order_until_its_end() -> None:
    ours, (theirs_in, theirs_out) = pipe.Pipe.pair()
    theirs = pipe.Pipe(theirs_in, theirs_out)
    assert ours.send(pipe.Begin())
    assert ours.send(pipe.TruthReply(Position(1.0, 2.0, AMSL(3.0))))
    assert theirs.receive() == pipe.Begin()
    assert theirs.receive() == pipe.TruthReply(Position(1.0, 2.0, AMSL(3.0)))
    os.write(theirs_out, b"half a pickle")
    theirs.close()
    with pytest.raises(EOFError):
        ours.receive()
