"""Program that becomes a firmware: with sockets for its parent, in a network of its own where it may be.

It is started as a script and imports nothing of volery, so that it is ready within milliseconds. Firmwares
listen at all addresses of a computer, and at ports that depend on an instance number alone. In a network
namespace no other program reaches them, and each may have the usual ports. Sockets that are made here belong
to that network also when the parent uses them.

Usage: ``launcher.py DESCRIPTOR JSON``. ``DESCRIPTOR`` is a Unix socket to the parent. ``JSON`` has

* the ``command``, in whose arguments ``{instance}`` and the ``{port0}``, ``{port1}`` ... of the sockets are
  replaced, and the ``environment`` to add;
* the ``sockets`` to make, and the ports that the firmware will ``listen`` at, each [kind, port, stride];
* the ``lock``, a file that an instance locks for as long as it runs, with ``{instance}`` in its name (empty:
  none);
* whether to try a network of its own (``isolate``), the ``core`` that it runs on alone (null: on all), taken
  modulo their number, and the process id of the ``parent``.

The file is locked here by ``flock``, for the whole life of the process, and by the firmware by ``fcntl``,
which is another kind of lock. So an instance number is taken before the firmware itself takes it.

The answer is JSON with the ``instance`` and whether it is ``isolated``, with the sockets beside it, or with
an ``error``.
"""

import contextlib
import ctypes
import fcntl
import json
import os
import signal
import socket
import struct
import sys
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1
_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000
_SET_FLAGS, _UP_AND_RUNNING = 0x8914, 0x41
_INSTANCES = 200
Ports = list[tuple[str, int, int]]
_KINDS = {"tcp": socket.SOCK_STREAM, "udp": socket.SOCK_DGRAM}


def _isolate(libc: ctypes.CDLL) -> bool:
    user, group = os.getuid(), os.getgid()
    if libc.unshare(_CLONE_NEWNET) != 0:
        if libc.unshare(_CLONE_NEWUSER | _CLONE_NEWNET) != 0:
            return False
        with contextlib.suppress(OSError):  # files keep their owner without it
            for name, text in (
                ("setgroups", "deny"),
                ("uid_map", f"{user} {user} 1"),
                ("gid_map", f"{group} {group} 1"),
            ):
                Path("/proc/self", name).write_text(text, encoding="ascii")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sH14s", b"lo", _UP_AND_RUNNING, b""))
    return True


def _bound(kind: str, port: int, address: str = "127.0.0.1") -> socket.socket:
    made = socket.socket(socket.AF_INET, _KINDS[kind])
    try:
        if kind == "tcp":
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((address, port))
        if kind == "tcp":
            made.listen(1)
    except BaseException:
        made.close()
        raise
    return made


def _sockets(wanted: Ports, listens: Ports, instance: int) -> list[socket.socket]:
    """Return the sockets of an instance; raise OSError if a port of it is taken."""
    made = []
    try:
        for kind, port, stride in wanted:
            made.append(_bound(kind, port + stride * instance))
        for kind, port, stride in listens:
            _bound(kind, port + stride * instance, "0.0.0.0").close()
    except OSError:
        for one in made:
            one.close()
        raise
    return made


def _lock(name: str) -> int:
    """Lock a file until this process ends; raise OSError if another program has locked it."""
    file = os.open(name, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.lockf(file, fcntl.LOCK_UN)
    except OSError:
        os.close(file)
        raise
    return file


def _take(asked: dict[str, Any], instance: int) -> list[socket.socket]:
    """Return the sockets of an instance; raise OSError if it runs already, or a port of it is taken."""
    lock = _lock(asked["lock"].replace("{instance}", str(instance))) if asked["lock"] else None
    try:
        made = _sockets(asked["sockets"], asked["listen"], instance)
    except OSError:
        if lock is not None:
            os.close(lock)
        raise
    if lock is not None:
        os.set_inheritable(lock, True)
    return made


def _prepare(asked: dict[str, Any], libc: ctypes.CDLL) -> tuple[int, bool, list[socket.socket]]:
    isolated = asked["isolate"] and _isolate(libc)
    for instance in range(_INSTANCES):
        try:
            return instance, isolated, _take(asked, instance)
        except OSError as error:
            problem = error
    raise problem


def main() -> None:
    """Answer the parent and become the firmware."""
    parent = socket.socket(fileno=int(sys.argv[1]))
    os.set_inheritable(parent.fileno(), False)  # the parent sees its end once the firmware runs
    asked = json.loads(sys.argv[2])
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != asked["parent"]:  # it died before the call above
        os._exit(1)
    try:
        instance, isolated, made = _prepare(asked, libc)
        answer = json.dumps({"instance": instance, "isolated": isolated}).encode()
        socket.send_fds(parent, [answer], [one.fileno() for one in made])
        names = {"{instance}": instance}
        names.update({f"{{port{at}}}": one.getsockname()[1] for at, one in enumerate(made)})
        if asked["core"] is not None:
            cores = sorted(os.sched_getaffinity(0))
            os.sched_setaffinity(0, {cores[asked["core"] % len(cores)]})
        command = asked["command"]
        for name, value in names.items():
            command = [part.replace(name, str(value)) for part in command]
        os.execve(command[0], command, {**os.environ, **asked["environment"]})
    except OSError as error:
        parent.send(json.dumps({"error": error.strerror or str(error)}).encode())
        os._exit(1)


if __name__ == "__main__":
    main()
