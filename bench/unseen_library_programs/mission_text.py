"""A mission in lines of text becomes JSON and back; comments are removed, numbers are checked."""

import json
import re

LINE = re.compile(r"^(?P<number>\d+)\s+(?P<command>[A-Z_]+)\s+(?P<rest>[-0-9. ]+)$")
COMMENT = re.compile(r"\s*#.*$")


def prepare(seed):
    kinds = ("WAYPOINT", "LOITER_TIME", "TAKEOFF", "DO_SET_SERVO")
    return "\n".join(
        f"{n} {kinds[(n * seed) % 4]} {43.0 + n * 1e-4:.7f} {-3.8 - n * 1e-4:.7f} {20 + n % 9} # leg {n}"
        for n in range(160)
    )


def run(text):
    items = []
    for line in text.splitlines():
        found = LINE.match(COMMENT.sub("", line))
        if not found:
            continue
        numbers = [float(one) for one in found.group("rest").split()]
        items.append(
            {"seq": int(found.group("number")), "command": found.group("command"), "params": numbers}
        )
    plan = json.dumps({"fileType": "Plan", "mission": {"items": items}}, indent=None)
    read = json.loads(plan)
    high = [one for one in read["mission"]["items"] if one["params"][2] > 24.0]
    return len(plan) + sum(one["seq"] for one in high)
