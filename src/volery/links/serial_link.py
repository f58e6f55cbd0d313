"""Links over a serial line: a radio modem, a USB cable or a pseudo terminal."""

from __future__ import annotations

import serial

from volery.kernel.api import Kernel
from volery.links.coded_link import ByteStream, StreamLink
from volery.links.link import Codec
from volery.links.mavlink_codec import MAVLINK

_READ_SIZE = 4096


class _SerialStream:
    """An open serial port as a ``ByteStream``; pyserial's errors are ``OSError``s."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def fileno(self) -> int:
        return int(self._port.fileno())

    def read(self) -> bytes:
        return bytes(self._port.read(_READ_SIZE))

    def write(self, data: bytes) -> int:
        return int(self._port.write(data) or 0)

    def close(self) -> None:
        self._port.close()


class SerialLink(StreamLink):
    """Opens *device* at *baud*, and again whenever the device returns (a replugged adapter)."""

    def __init__(
        self, kernel: Kernel, device: str, baud: int, name: str = "", codec: Codec = MAVLINK
    ) -> None:
        self._device, self._baud = device, baud
        super().__init__(kernel, name or f"serial://{device}", codec)

    def _open(self) -> ByteStream:
        return _SerialStream(serial.Serial(self._device, self._baud, timeout=0, write_timeout=0))

    def _explain(self, error: Exception) -> str:
        if not isinstance(error, OSError):
            return f"{self._device}: {error}"
        if isinstance(error, serial.SerialException) and error.errno is None:
            return f"{self._device}: {error}"
        if error.errno == 2:
            return f"there is no device {self._device}; list them with: python -m serial.tools.list_ports"
        if error.errno == 13:
            return f"no permission to open {self._device}; add yourself to its group, usually dialout"
        return f"{self._device}: {error.strerror or error}"

    def _connection_problem(self) -> str:
        problem = super()._connection_problem()
        if not problem and not self.statistics.octets:
            return f"{self._device} is open at {self._baud} baud, but nothing arrives"
        return problem
