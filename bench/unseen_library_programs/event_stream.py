"""Events of a fleet as lines of JSON: read, filtered by expressions, counted, written again compressed."""

import json
import re
import zlib
from collections import Counter

WARNING = re.compile(r"(?:low battery|link lost|wind) \((\d+)\s?%?\)")
UNIT = re.compile(r"[a-z]+\d{2}")


def prepare(seed):
    texts = ("low battery (23 %)", "at way point 7", "link lost (4)", "landed", "wind (12)")
    return [
        json.dumps(
            {
                "t": 1700000000.25 + k * 0.13,
                "unit": f"uav{(k * seed) % 40:02d}",
                "level": "WARN" if k % 5 in (0, 2, 4) else "INFO",
                "text": texts[k % 5],
                "position": {"lat": 46.08 + k * 1.7e-5, "lon": -103.9 - k * 2.3e-5, "alt": 40 + k % 13},
            }
        )
        for k in range(180)
    ]


def run(lines):
    counts, kept = Counter(), []
    for line in lines:
        event = json.loads(line)
        found = WARNING.search(event["text"])
        if found and UNIT.fullmatch(event["unit"]):
            counts[event["unit"]] += int(found.group(1))
            kept.append(json.dumps({"u": event["unit"], "n": int(found.group(1)), **event["position"]}))
    body = "\n".join(kept).encode()
    packed = zlib.compress(body, 6)
    again = zlib.decompress(packed).decode().split("\n")
    return sum(counts.values()) + len(packed) + len(again) + zlib.crc32(body) % 7
