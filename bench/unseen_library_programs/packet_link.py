"""Frames of a radio link: headers and readings as binary, a digest as their seal, losses, and reassembly."""

import hashlib
import struct

import numpy as np

HEADER = struct.Struct(">HHIB")


def prepare(seed):
    rng = np.random.default_rng(seed)
    return [rng.integers(-2000, 2000, 48).astype(np.int16) for _ in range(60)], b"key %d" % seed


def run(given):
    blocks, key = given
    frames = []
    for number, block in enumerate(blocks):
        body = block.astype(">i2").tobytes()
        head = HEADER.pack(0xFE55, number, number * 40, len(block))
        seal = hashlib.sha256(key + head + body).digest()[:8]
        frames.append(head + body + seal)
    total, parts = 0, []
    for frame in frames:
        start, number, time, count = HEADER.unpack_from(frame)
        if start != 0xFE55 or number % 13 == 5:
            continue
        if hashlib.sha256(key + frame[:-8]).digest()[:8] != frame[-8:]:
            continue
        values = np.frombuffer(frame, dtype=">i2", count=count, offset=HEADER.size)
        parts.append(values.astype(np.float64) * 0.01)
        total += time + int(values.max())
    signal = np.concatenate(parts)
    return total + float(signal.std()) + float(np.abs(signal).mean())
