"""A mission as JSON, written, read and sorted many times."""

import json


def run(seed):
    items = [
        {
            "id": k,
            "lat": 46.0 + (k * seed % 97) * 1e-4,
            "lon": -103.0 + k * 1e-4,
            "alt": 20 + k % 7,
            "name": f"wp {k}",
        }
        for k in range(40)
    ]
    total = 0
    for k in range(25):
        text = json.dumps({"items": items, "round": k})
        back = json.loads(text)
        back["items"].sort(key=lambda one: one["alt"])
        items = sorted(back["items"], key=lambda one: one["id"])
        total += len(text)
    return total


def prepare(seed):
    return seed
