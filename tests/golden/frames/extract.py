"""Pick frames of every kind from recordings of real firmware: what hostile bytes are made of.

    python tests/golden/frames/extract.py FOLDER

FOLDER holds telemetry logs (8-byte big-endian microseconds, then a MAVLink frame). Writes ``mavlink.txt``
beside this file: for each firmware, direction and message up to three frames (the first, one from the middle,
the last), each a line of its firmware and its bytes in hexadecimal digits.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

STAMP, AROUND, SIGNATURE, SIGNED = 8, 12, 13, 1
STX = 0xFD


def frames(path: Path) -> Iterator[bytes]:
    data, place = path.read_bytes(), 0
    while place + STAMP + AROUND <= len(data):
        start = place + STAMP
        if data[start] != STX:
            raise SystemExit(f"{path}: no MAVLink 2 frame at {start}")
        length = AROUND + data[start + 1] + (SIGNATURE if data[start + 2] & SIGNED else 0)
        yield data[start : start + length]
        place = start + length


def main() -> None:
    found: dict[tuple[str, int, bytes], list[bytes]] = defaultdict(list)
    for path in sorted(Path(sys.argv[1]).glob("*.tlog")):
        firmware = path.name.partition("-")[0]
        for frame in frames(path):
            found[firmware, frame[5], frame[7:10]].append(frame)
    lines = []
    for (firmware, _, _), all_of_them in sorted(found.items()):
        chosen = {0, len(all_of_them) // 2, len(all_of_them) - 1}
        lines += [f"{firmware} {all_of_them[number].hex()}" for number in sorted(chosen)]
    target = Path(__file__).with_name("mavlink.txt")
    target.write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
