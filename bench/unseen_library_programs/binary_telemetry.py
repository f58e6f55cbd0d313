"""Records of a telemetry link are packed, summed, read back and unpacked."""

import struct
import zlib

RECORD = struct.Struct("<BBHIiiihh")


def prepare(seed):
    return [
        (0xA5, k % 256, k, k * 20, 460825000 + k * seed, -1038995000 - k, 900000 + k, k % 300, -k % 300)
        for k in range(300)
    ]


def run(records):
    frames = bytearray()
    for record in records:
        body = RECORD.pack(*record)
        frames += body + struct.pack("<I", zlib.crc32(body))
    total, at, size = 0, 0, RECORD.size
    while at < len(frames):
        body = bytes(frames[at : at + size])
        (stated,) = struct.unpack_from("<I", frames, at + size)
        if zlib.crc32(body) == stated:
            fields = RECORD.unpack(body)
            total += fields[4] + fields[7]
        at += size + 4
    return total
