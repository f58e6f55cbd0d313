"""Bytes packed and unpacked by hand: integers, shifts, bytearrays, loops with while."""

from random import Random


def table(polynomial):
    entries = []
    for value in range(64):
        for _ in range(8):
            value = (value >> 1) ^ polynomial if value & 1 else value >> 1  # noqa: PLW2901
        entries.append(value)
    return entries


def pack(values, widths):
    out, held, bits = bytearray(), 0, 0
    for value, width in zip(values, widths, strict=True):
        held |= (value & ((1 << width) - 1)) << bits
        bits += width
        while bits >= 8:
            out.append(held & 0xFF)
            held >>= 8
            bits -= 8
    if bits:
        out.append(held)
    return out


def unpack(data, widths):
    found, held, bits, place = [], 0, 0, 0
    for width in widths:
        while bits < width:
            held |= data[place] << bits
            place += 1
            bits += 8
        found.append(held & ((1 << width) - 1))
        held >>= width
        bits -= width
    return found


def prepare(seed):
    random = Random(seed)
    widths = [random.randrange(1, 15) for _ in range(400)]
    return [random.randrange(1 << width) for width in widths], widths


def run(state):
    values, widths = state
    data = pack(values, widths)
    crc = 0
    entries = table(0xA001)
    for byte in data:
        crc = (crc >> 6) ^ entries[(crc ^ byte) & 0x3F]
    return unpack(data, widths) == values, crc
