"""Tiles of a map are compressed, named by their digest, and read again."""

import hashlib
import zlib


def prepare(seed):
    return [
        bytes((x * y * seed + tile) // 7 % 251 for y in range(48) for x in range(48)) for tile in range(10)
    ]


def run(tiles):
    store = {}
    for tile in tiles:
        packed = zlib.compress(tile, 6)
        store[hashlib.sha256(packed).hexdigest()] = packed
    total = 0
    for name, packed in store.items():
        if hashlib.sha256(packed).hexdigest() == name:
            total += sum(zlib.decompress(packed)[::16])
    return total
