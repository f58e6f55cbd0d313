"""Binary records of a flight are packed, checked, compressed in blocks, and read again."""

import struct
import zlib

RECORD = struct.Struct("<QdddfffB")


def prepare(seed):
    return [
        (1000 * n, 43.0 + n * 1e-6 * seed, -3.8, 100.0 + n % 37, n * 0.1 % 6.28, 0.01 * n, -0.5, n % 7)
        for n in range(900)
    ]


def run(records):
    blocks = []
    for start in range(0, len(records), 100):
        body = b"".join(RECORD.pack(*one) for one in records[start : start + 100])
        blocks.append(struct.pack("<IH", zlib.crc32(body), len(body)) + zlib.compress(body, 6))
    highest = 0.0
    for block in blocks:
        check, length = struct.unpack_from("<IH", block)
        body = zlib.decompress(block[6:])
        if zlib.crc32(body) != check or len(body) != length:
            continue
        for one in RECORD.iter_unpack(body):
            highest = max(highest, one[3])
    return highest + sum(map(len, blocks))
