"""A byte stream of frames with a checksum, cut and checked byte by byte as a small parser does it."""

from random import Random

START, HEAD = 0xFD, 3


def checksum(data):
    crc = 0xFFFF
    for byte in data:
        mixed = byte ^ (crc & 0xFF)
        mixed ^= (mixed << 4) & 0xFF
        crc = (crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)
    return crc & 0xFFFF


class Parser:
    def __init__(self):
        self.state = "idle"
        self.frame = bytearray()
        self.good = self.bad = 0
        self.messages = {}

    def feed(self, byte):
        if self.state == "idle":
            if byte == START:
                self.frame = bytearray()
                self.state = "head"
            return
        self.frame.append(byte)
        if self.state == "head" and len(self.frame) == HEAD:
            self.state = "body"
        if self.state == "body" and len(self.frame) == HEAD + self.frame[0] + 2:
            self.finish()
            self.state = "idle"

    def finish(self):
        body, low, high = self.frame[:-2], self.frame[-2], self.frame[-1]
        if checksum(body) != low | high << 8:
            self.bad += 1
            return
        self.good += 1
        kind = body[2]
        self.messages[kind] = self.messages.get(kind, 0) + 1


def prepare(seed):
    random = Random(seed)
    stream = bytearray()
    for number in range(100):
        size = random.randrange(9, 50)
        body = bytes(
            [size, number & 0xFF, random.randrange(8), *(random.randrange(256) for _ in range(size))]
        )
        crc = checksum(body)
        stream += bytes([START]) + body + bytes([crc & 0xFF, crc >> 8])
        stream += bytes(random.randrange(200) for _ in range(random.randrange(4)))
    for _ in range(20):
        stream[random.randrange(len(stream))] ^= 0x10
    return bytes(stream)


def run(state):
    parser = Parser()
    for byte in state:
        parser.feed(byte)
    return parser.good, parser.bad, parser.messages
