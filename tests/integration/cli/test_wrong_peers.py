"""`volery fly` on an address where something else than an autopilot of MAVLink 2 answers."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, closing, contextmanager, suppress
from typing import TYPE_CHECKING

import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink_1

from volery.cli.commands.first_steps import example

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.integration

WITHIN_S = 300


def heartbeat_of_version_1() -> bytes:
    sender = mavlink_1.MAVLink(None, srcSystem=1)
    message = mavlink_1.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
    return bytes(message.pack(sender))


PEERS = {
    "text": (b"SSH-2.0-OpenSSH_9.2\r\n", "text"),
    "garbage": (bytes(range(1, 90)) * 4, "MAVLink"),
    "MAVLink 1": (heartbeat_of_version_1(), "MAVLink 1"),
}
"""What each says again and again, and a word of what the user is told."""


@contextmanager
def peer(words: bytes) -> Iterator[str]:
    """A server that says *words* to whoever connects, until the context ends."""
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        over = threading.Event()

        def serve() -> None:
            with suppress(OSError):
                connected, _ = listener.accept()
                with connected:
                    while not over.wait(0.1):
                        connected.sendall(words)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"ardupilot+tcp://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            over.set()
            with suppress(OSError), closing(socket.create_connection(listener.getsockname(), 1)):
                thread.join(WITHIN_S)


def test_the_message_names_what_answers_instead(tmp_path):
    """All at once: each waits its ten seconds for an autopilot."""
    with ExitStack() as stack:
        flights = {}
        for name, (words, _) in PEERS.items():
            url = stack.enter_context(peer(words))
            command = ("fly", str(example("mission.py")), "--on", url, "--out", str(tmp_path / name))
            flights[name] = subprocess.Popen(
                [sys.executable, "-c", "from volery.cli.main import main; main()", *command],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        said = {name: flight.communicate(timeout=WITHIN_S)[1] for name, flight in flights.items()}
    for name, (_, told) in PEERS.items():
        assert flights[name].returncode == 1, name
        assert told in said[name], said[name]
        assert "Traceback" not in said[name]
