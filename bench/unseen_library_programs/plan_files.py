"""A plan of a ground station is written with indents, read again and checked field by field."""

import json


def prepare(seed):
    return {
        "fileType": "Plan",
        "version": 1,
        "mission": {
            "plannedHomePosition": [46.0825, -103.8995, 900.0],
            "items": [
                {
                    "type": "SimpleItem",
                    "command": 16 if k % 9 else 21,
                    "frame": 3,
                    "autoContinue": True,
                    "params": [0, 0, 0, None, 46.0825 + k * seed * 1e-5, -103.9 + k * 1e-5, 30.0 + k % 5],
                }
                for k in range(120)
            ],
        },
        "geoFence": {"circles": [], "polygons": [{"inclusion": True, "polygon": [[46.0, -103.9]] * 12}]},
    }


def run(plan):
    total = 0.0
    for indent in (4, None, 2):
        text = json.dumps(plan, indent=indent, sort_keys=True)
        for item in json.loads(text)["mission"]["items"]:
            if item["command"] == 16:
                total += item["params"][6]
        total += len(text)
    return total
