"""A served vehicle with more connections than it has room for, and peers that flood it or do not read."""

from __future__ import annotations

import re
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from volery.links.coded_link import MAX_UNHANDLED, ReaderThread
from volery.links.frame import Frame
from volery.links.mavlink_codec import MAVLINK, encode
from volery.links.stream_links import MAX_CLIENTS

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
BEAT = encode(Frame("HEARTBEAT", {"type": 6, "autopilot": 8, "mavlink_version": 3}, 255, 190), 0)
FEW_DESCRIPTORS = 96
IDLE = 1000

CROWD = f"""
import resource, socket, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (4096, max(4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1])))
idle = [socket.create_connection(("{HERE}", int(sys.argv[1])), 20) for _ in range({IDLE})]
slow = socket.socket()
slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
slow.connect(("{HERE}", int(sys.argv[1])))
slow.sendall(bytes.fromhex("{BEAT.hex()}"))
print("all connected", flush=True)
sys.stdin.read()
"""
"""A process of {IDLE} idle clients and one that sends a frame and never reads."""


def free_port() -> int:
    with socket.create_server((HERE, 0)) as listener:
        return int(listener.getsockname()[1])


def connect(port: int) -> socket.socket:
    """Connect as soon as the server listens."""
    for _ in range(300):
        try:
            return socket.create_connection((HERE, port), 20)
        except ConnectionRefusedError:
            time.sleep(0.1)
    raise AssertionError("the server does not listen")


@contextmanager
def served(notes: Path, descriptors: int | None = None) -> Iterator[int]:
    """Serve ArduPilot in a process with at most *descriptors* open files."""
    port = free_port()
    limit = "" if descriptors is None else f"resource.setrlimit(resource.RLIMIT_NOFILE, ({descriptors},) * 2)"
    program = f"import resource, sys\n{limit}\nfrom volery.cli.main import main; sys.exit(main())"
    listen = f"tcp://{HERE}:{port}"
    with (
        notes.open("w") as written,
        subprocess.Popen(
            [sys.executable, "-c", program, "vehicle", "serve", "ardupilot", "--listen", listen],
            stdout=subprocess.DEVNULL,
            stderr=written,
        ) as process,
    ):
        try:
            yield port
            assert process.poll() is None, "the server has ended"
        finally:
            process.terminate()
            process.wait(300)


def assert_served(client: socket.socket) -> None:
    """Check that *client* receives heartbeats of the vehicle."""
    client.settimeout(20)
    client.sendall(BEAT)
    parser = MAVLINK.parser()
    names: list[str] = []
    while names.count("HEARTBEAT") < 2:
        data = client.recv(4096)
        assert data, "the server has closed the connection"
        names += [frame.name for frame in parser.feed(data)]


@pytest.mark.parametrize("descriptors", [None, FEW_DESCRIPTORS])
def test_a_thousand_idle_clients_and_a_slow_one_do_not_end_a_server(
    tmp_path: Path, descriptors: int | None
) -> None:
    notes = tmp_path / "notes"
    with ExitStack() as undo:
        port = undo.enter_context(served(notes, descriptors))
        first = undo.enter_context(connect(port))
        assert_served(first)
        crowd = undo.enter_context(
            subprocess.Popen(
                [sys.executable, "-c", CROWD, str(port)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        )
        assert crowd.stdout is not None
        assert crowd.stdin is not None
        assert crowd.stdout.readline() == b"all connected\n"
        assert_served(first)
        assert_served(undo.enter_context(connect(port)))
        crowd.stdin.close()
    text = notes.read_text()
    assert re.search(rf"{MAX_CLIENTS} clients are connected|Too many open files", text), text
    assert "Traceback" not in text


def test_what_one_connection_may_leave_unhandled_is_bounded() -> None:
    """A kernel that handles nothing stops the reader; the sender's socket fills instead of the memory."""

    class IdleKernel:
        def __init__(self) -> None:
            self.posted: list[object] = []

        def post(self, action: object) -> None:
            self.posted.append(action)

    kernel = IdleKernel()
    ours, theirs = socket.socketpair()

    def read(reader: ReaderThread) -> None:
        while reader.readable(ours.fileno()):
            reader.post(kernel, lambda data: None, ours.recv(4096))  # type: ignore[arg-type]

    reader = ReaderThread("bounded", read)
    reader.start()
    theirs.settimeout(1.0)
    with pytest.raises(TimeoutError):
        theirs.sendall(bytes(100 * MAX_UNHANDLED))
    assert len(kernel.posted) * 4096 <= MAX_UNHANDLED + 4096
    reader.stop()
    for one in (ours, theirs):
        one.close()


def test_a_descriptor_above_those_of_select_is_waited_for() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft <= 1100:
        program = (
            "import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, (2048, "
            f"{hard})); sys.path.insert(0, {str(Path(__file__).parent)!r}); "
            "import test_many_connections as tests; tests.wait_at_a_high_descriptor()"
        )
        assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
    else:
        wait_at_a_high_descriptor()


def wait_at_a_high_descriptor() -> None:
    """Read through a descriptor above 1023."""
    import fcntl

    ours, theirs = socket.socketpair()
    high = fcntl.fcntl(ours.fileno(), fcntl.F_DUPFD, 1030)
    read: list[bool] = []
    reader = ReaderThread("high", lambda thread: read.append(thread.readable(high)))
    theirs.sendall(b"!")
    reader.start()
    reader._thread.join(300)
    assert read == [True]
    reader.stop()
