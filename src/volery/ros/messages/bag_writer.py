"""Writers of recordings: rosbag 1, or rosbag 2 in MCAP."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, Self

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1 import WriterError as Writer1Error
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2 import WriterError as Writer2Error

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.messages.cdr import to_cdr
from volery.ros.messages.message import Message
from volery.ros.messages.ros1 import ros1_type, to_ros1
from volery.ros.messages.store import message_class, message_name, store

_METADATA_VERSION: Literal[9] = 9
"""Version of rosbag2's metadata.yaml; Jazzy and later write it, Iron and later read it."""


class BagWriter(Protocol):
    """A recording in progress; a context manager. It must be closed to be complete."""

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message at time `at`, ns; raise ``UsageError`` if this format does not support its type."""

    def close(self) -> None:
        """Complete the recording."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class _Writer:
    def __init__(self, path: Path, writer: Any) -> None:
        self._path = path
        self._writer = writer
        self._connections: dict[str, tuple[str, Connection]] = {}
        try:
            writer.open()
        except (Writer1Error, Writer2Error, OSError) as error:
            raise UsageError(f"{path} cannot be written: {error}") from error

    def _connection(self, topic: str, name: str) -> Connection:
        known = self._connections.get(topic)
        if known is None:
            known = self._connections[topic] = name, self._connect(topic, name)
        if known[0] != name:
            raise UsageError(f"{self._path}: topic {topic} carries {known[0]}, not {name}")
        return known[1]

    def _connect(self, topic: str, name: str) -> Connection:
        raise NotImplementedError

    def close(self) -> None:
        """Complete the recording."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class Rosbag1Writer(_Writer):
    """Writer of a ``.bag`` file, which ROS 1 and Debian's ``rosbag`` read."""

    def __init__(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        super().__init__(path, Writer1(path))

    def _connect(self, topic: str, name: str) -> Connection:
        kind = ros1_type(name)
        made: Connection = self._writer.add_connection(
            topic, message_name(name), msgdef=kind.text, md5sum=kind.md5
        )
        return made

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message."""
        self._writer.write(self._connection(topic, message.__msgtype__), at, to_ros1(message))


class Rosbag2Writer(_Writer):
    """Writer of a folder with an MCAP file, which ``ros2 bag``, Foxglove and PlotJuggler read."""

    def __init__(self, path: Path) -> None:
        if path.is_dir() and (path / "metadata.yaml").exists():
            shutil.rmtree(path)
        super().__init__(path, Writer2(path, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP))

    def _connect(self, topic: str, name: str) -> Connection:
        message_class(name)
        made: Connection = self._writer.add_connection(topic, message_name(name), typestore=store())
        return made

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message."""
        self._writer.write(self._connection(topic, message.__msgtype__), at, to_cdr(message))


def create_bag(path: Path) -> BagWriter:
    """Begin a recording; an older one of the same kind is replaced.

    Args:
        path: ``NAME.bag`` for a rosbag 1, any other name for the folder of a rosbag 2 in MCAP.

    Raises:
        UsageError: it cannot be written there.
    """
    return Rosbag1Writer(path) if path.suffix == ".bag" else Rosbag2Writer(path)
