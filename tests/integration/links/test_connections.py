"""Real sockets and a real pseudo terminal, on ports that the system hands out."""

from __future__ import annotations

import os
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace

import pytest

from volery.base.errors import UsageError
from volery.base.time import MINUTE, S
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.kernel.wall import WallKernel
from volery.links.coded_link import CodedLink
from volery.links.frame import Frame
from volery.links.mavlink_codec import encode
from volery.links.stream_links import SerialLink, TcpClient, TcpServer
from volery.links.udp_link import UdpLink, UdpServer
from volery.trace.events import LinkState
from volery.vehicles.address import listen, open_link, parse, parse_listen

pytestmark = pytest.mark.integration

BEAT = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "mavlink_version": 3}, 1, 1)
ASK = Frame("HEARTBEAT", {"type": 6, "autopilot": 8, "mavlink_version": 3}, 255, 190)
HERE = "127.0.0.1"


class Bench:
    """A wall clock, the frames that its links received, and ``until``, which runs until a condition holds."""

    def __init__(self) -> None:
        self.states: list[LinkState] = []
        self.kernel = WallKernel(record=self._record)
        self.changed = Signal(self.kernel, "the bench")
        self.links: list[CodedLink] = []
        self.received: dict[CodedLink, list[Frame]] = {}
        self._asked = 0

    def _record(self, event: object) -> None:
        if isinstance(event, LinkState):
            self.states.append(event)
            self.changed.notify()

    def add(self, link: CodedLink) -> CodedLink:
        self.links.append(link)
        self.received[link] = []

        def note(frame: Frame) -> None:
            self.received[link].append(frame)
            self.changed.notify()

        link.receive(note)
        return link

    def until(self, holds: Callable[[], object]) -> None:
        """Run until it *holds*; it is looked at after every event and each 20 ms."""
        seen: list[bool] = []
        scope = self.kernel.root.child(f"wait {self._asked}")
        self._asked += 1
        look = self.kernel.every(S // 50, self.changed.notify)

        def wait() -> None:
            seen.append(self.changed.wait_for(holds, MINUTE))
            stop.set()

        stop = threading.Event()
        self.kernel.start()
        self.kernel.spawn(wait, "wait", ExecutionContext("test"), scope)
        assert stop.wait(70), "the wait never ended"
        look.cancel()
        assert seen == [True]

    def close(self) -> None:
        for link in self.links:
            link.close()
        assert self.kernel.close() == []


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    before = threading.active_count()
    yield bench
    bench.close()
    assert threading.active_count() <= before, "a thread was left behind"


def free_port() -> int:
    with socket.create_server((HERE, 0)) as listener:
        return int(listener.getsockname()[1])


def test_a_client_and_a_server_talk_both_ways(bench: Bench) -> None:
    server = bench.add(TcpServer(bench.kernel, HERE, 0))
    client = bench.add(TcpClient(bench.kernel, HERE, server.port))
    bench.until(lambda: not client.problem())
    client.send(ASK)
    bench.until(lambda: bench.received[server])
    server.send(BEAT)
    bench.until(lambda: bench.received[client])
    assert bench.received[client][0].fields["autopilot"] == 3


def test_a_server_serves_several_clients_and_survives_one_that_leaves(bench: Bench) -> None:
    joined: list[str] = []
    server = TcpServer(bench.kernel, HERE, 0, on_connect=lambda: joined.append("one"))
    bench.add(server)
    assert "no client has connected" in server.problem()
    first = bench.add(TcpClient(bench.kernel, HERE, server.port))
    second = bench.add(TcpClient(bench.kernel, HERE, server.port))
    bench.until(lambda: server.clients == 2)
    server.send_bytes(b"Init ArduCopter\n")
    server.send(BEAT)
    bench.until(lambda: bench.received[first] and bench.received[second])
    assert list(first.statistics.lines) == ["Init ArduCopter"]
    first.close()
    bench.until(lambda: server.clients == 1)
    server.send(BEAT)
    bench.until(lambda: len(bench.received[second]) == 2)
    assert joined == ["one", "one"]


def test_what_waits_for_a_client_that_does_not_read_is_bounded(bench: Bench) -> None:
    """Else it would get answers after all that was sent before: seconds later, or minutes."""
    server = TcpServer(bench.kernel, HERE, 0)
    bench.add(server)
    assert server.has_room()
    with socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.connect((HERE, server.port))
        bench.until(lambda: server.clients == 1)
        data = bytes(1000)
        sent = 0
        while server.has_room():
            server.send_bytes(data)
            sent += len(data)
            assert sent < 300_000
        bench.until(lambda: slow.recv(4096, socket.MSG_DONTWAIT) and server.has_room())


def test_a_url_with_no_listener_says_so_and_is_tried_again(bench: Bench) -> None:
    port = free_port()
    client = bench.add(TcpClient(bench.kernel, HERE, port))
    bench.until(lambda: "nothing listens" in client.problem())
    assert f"{HERE}:{port}" in client.problem()
    bench.add(TcpServer(bench.kernel, HERE, port))
    bench.until(lambda: not client.problem())


def test_a_connection_that_breaks_comes_back(bench: Bench) -> None:
    port = free_port()
    server = bench.add(TcpServer(bench.kernel, HERE, port))
    client = bench.add(TcpClient(bench.kernel, HERE, port, "client"))
    bench.until(lambda: not client.problem())
    server.close()
    bench.until(client.problem)
    again = bench.add(TcpServer(bench.kernel, HERE, port))
    bench.until(lambda: not client.problem())
    client.send(ASK)
    bench.until(lambda: bench.received[again])
    assert [state.state for state in bench.states if state.link == client.name] == ["up", "lost", "back"]


@pytest.mark.parametrize(
    ("sent", "expected"),
    [(b"SSH-2.0-OpenSSH_9.6\r\n", "only text arrives: 'SSH-2.0"), (bytes(range(130, 200)), "no MAVLink")],
)
def test_another_protocol_is_named(bench: Bench, sent: bytes, expected: str) -> None:
    with closing(socket.create_server((HERE, 0))) as listener:
        client = bench.add(TcpClient(bench.kernel, HERE, listener.getsockname()[1]))
        with closing(listener.accept()[0]) as peer:
            peer.sendall(sent)
            bench.until(lambda: expected in client.problem())


def test_a_host_that_does_not_exist(bench: Bench) -> None:
    client = bench.add(TcpClient(bench.kernel, "no-such-host.invalid", 5760))
    bench.until(lambda: "no host" in client.problem())


def test_a_port_that_is_taken(bench: Bench) -> None:
    with socket.create_server((HERE, 0)) as listener, pytest.raises(UsageError, match="cannot listen at tcp"):
        TcpServer(bench.kernel, HERE, listener.getsockname()[1])


def test_a_bound_udp_link_answers_the_first_sender_only(bench: Bench) -> None:
    bound = UdpLink(bench.kernel, HERE, 0)
    bench.add(bound)
    assert "nothing arrives at" in bound.problem()
    first = bench.add(UdpLink(bench.kernel, HERE, 0, (HERE, bound.port)))
    assert "no answer" in first.problem()
    first.send(BEAT)
    bench.until(lambda: bench.received[bound])
    other = bench.add(UdpLink(bench.kernel, HERE, 0, (HERE, bound.port)))
    other.send(BEAT)
    bound.send(ASK)
    bench.until(lambda: bench.received[first])
    first.send(BEAT)
    bench.until(lambda: len(bench.received[bound]) == 2)  # the other's was not one of them
    assert bench.received[other] == []
    assert bound.problem() == first.problem() == ""


def test_a_link_to_a_udp_peer_on_loopback_is_bound_there_and_receives_the_peer_only(
    bench: Bench,
) -> None:
    with (
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as peer,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as spoofer,
    ):
        peer.bind((HERE, 0))
        ours = UdpLink(bench.kernel, "", 0, ("localhost", peer.getsockname()[1]))
        bench.add(ours)
        assert ours._socket.getsockname()[0] == HERE
        for sender, frame in ((spoofer, ASK), (peer, BEAT)):
            sender.sendto(encode(frame, 0), (HERE, ours.port))
        bench.until(lambda: bench.received[ours])
        assert [frame.system for frame in bench.received[ours]] == [BEAT.system]


def test_a_udp_port_is_bound_where_the_address_says(bench: Bench) -> None:
    bound = open_link(bench.kernel, parse(f"ardupilot+udp://:{free_port()}?bind={HERE}"))
    bench.add(bound)
    assert isinstance(bound, UdpLink)
    assert bound._socket.getsockname()[0] == HERE
    with pytest.raises(UsageError, match="bind is for udp://:PORT"):
        open_link(bench.kernel, parse(f"ardupilot+udp://{HERE}:14550?bind={HERE}"))


def test_a_udp_server_takes_the_frames_of_a_system_from_one_address(bench: Bench) -> None:
    server = UdpServer(bench.kernel, HERE, 0)
    bench.add(server)
    with (
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as vehicle,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as spoofer,
    ):
        forged = replace(BEAT, fields={**BEAT.fields, "type": 99})
        vehicle.sendto(encode(BEAT, 0), (HERE, server.port))
        bench.until(lambda: bench.received[server])
        spoofer.sendto(encode(forged, 0), (HERE, server.port))
        spoofer.sendto(encode(ASK, 1), (HERE, server.port))
        bench.until(lambda: len(bench.received[server]) == 2)
        assert [frame.system for frame in bench.received[server]] == [BEAT.system, ASK.system]


def test_a_udp_port_that_is_taken(bench: Bench) -> None:
    taken = UdpLink(bench.kernel, HERE, 0)
    bench.add(taken)
    with pytest.raises(UsageError, match=f"cannot use udp {HERE}:{taken.port}"):
        UdpLink(bench.kernel, HERE, taken.port)


def test_a_serial_line_both_ways_and_its_end(bench: Bench) -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    line = bench.add(SerialLink(bench.kernel, os.ttyname(theirs), 57600))
    bench.until(lambda: "nothing arrives" in line.problem())
    os.write(ours, encode(BEAT, 0))
    bench.until(lambda: bench.received[line])
    line.send(ASK)
    assert os.read(ours, 300) == encode(ASK, 0)
    os.close(theirs)
    os.close(ours)
    bench.until(lambda: "lost" in [state.state for state in bench.states])
    assert line.problem()


def test_a_serial_device_that_is_not_there(bench: Bench) -> None:
    line = bench.add(SerialLink(bench.kernel, "/dev/ttyNONE0", 57600))
    bench.until(lambda: "no device /dev/ttyNONE0" in line.problem())


def test_links_from_addresses(bench: Bench) -> None:
    port = free_port()
    joined: list[str] = []
    server = bench.add(
        listen(bench.kernel, parse_listen(f"tcp://{HERE}:{port}"), on_connect=lambda: joined.append("one"))
    )
    client = bench.add(open_link(bench.kernel, parse(f"ardupilot+tcp://{HERE}:{port}")))
    bench.until(lambda: joined)
    server.send(BEAT)
    bench.until(lambda: bench.received[client])
    bound = UdpLink(bench.kernel, "", 0)
    bench.add(bound)
    for sender in (
        open_link(bench.kernel, parse(f"ardupilot+udp://{HERE}:{bound.port}")),
        listen(bench.kernel, parse_listen(f"udp://{HERE}:{bound.port}")),
    ):
        bench.add(sender)
    sender.send(BEAT)
    bench.until(lambda: bench.received[bound])


def test_a_link_that_is_closed_says_so_and_drops_what_is_sent(bench: Bench) -> None:
    client = bench.add(TcpClient(bench.kernel, HERE, free_port()))
    client.close()
    client.send(BEAT)
    client.send_bytes(b"text")
    client.arrived(encode(BEAT, 0))
    assert bench.received[client] == []
    assert client.problem() == "the link was closed"
