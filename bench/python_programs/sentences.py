"""NMEA sentences: split, checked and turned into fixes, text all along."""

from random import Random


def total(text):
    value = 0
    for character in text:
        value ^= ord(character)
    return value


def degrees(text, side):
    point = text.index(".") - 2
    value = int(text[:point]) + float(text[point:]) / 60
    return -value if side in "SW" else value


def fix(sentence):
    if not sentence.startswith("$") or "*" not in sentence:
        raise ValueError("no sentence")
    body, _, check = sentence[1:].partition("*")
    if total(body) != int(check, 16):
        raise ValueError("checksum")
    fields = body.split(",")
    if fields[0][2:] != "GGA" or not fields[6].isdigit():
        return None
    return {
        "time": f"{fields[1][0:2]}:{fields[1][2:4]}:{fields[1][4:6]}",
        "latitude": degrees(fields[2], fields[3]),
        "longitude": degrees(fields[4], fields[5]),
        "satellites": int(fields[7]),
    }


def prepare(seed):
    random = Random(seed)
    lines = []
    for number in range(300):
        kind = random.choice(["GPGGA", "GPGGA", "GPRMC"])
        body = (
            f"{kind},{120000 + number},{4300 + random.random() * 60:09.4f},N,"
            f"{350 + random.random() * 9:010.4f},W,1,{random.randrange(5, 14):02d},0.9,545.4,M"
        )
        check = total(body) ^ (random.random() < 0.1)
        lines.append(f"${body}*{check:02X}")
    return lines


def run(state):
    fixes, refused = [], 0
    for line in state:
        try:
            found = fix(line)
        except ValueError:
            refused += 1
            continue
        if found is not None:
            fixes.append(found)
    return len(fixes), refused, fixes[-1]["time"]
