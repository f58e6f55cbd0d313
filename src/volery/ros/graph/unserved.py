"""What nodes of a graph offered or asked for and no node took or served, with the name that was nearly right.

The graph keeps a `Want` for each topic, service and transform that a component uses. At the end of a run
``unserved`` returns those that were never met.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches

from volery.base.time import Ns
from volery.trace.events import Unserved

PUBLISHED, SUBSCRIBED, SERVICE, ACTION, TRANSFORM = (
    "publication", "subscription", "service", "action", "transform",
)  # fmt: skip
"""Kinds of wants: the first is an offer, the others are requests."""

_ORDER = (SERVICE, ACTION, TRANSFORM, SUBSCRIBED, PUBLISHED)

NEED_NOBODY = frozenset(
    "/" + name
    for name in (
        "clock", "diagnostics", "parameter_events", "rosout", "rosout_agg", "statistics", "tf", "tf_static",
    )
)  # fmt: skip
"""Topics that are complete with one side. Of ``/tf``, the transforms that were looked up are named."""

_ACTION_PARTS = ("/cancel", "/feedback", "/goal", "/result", "/status")
_ACTION_TYPES = ("ActionFeedback", "ActionGoal", "ActionResult", "/GoalID", "/GoalStatusArray")
_ACTION_OF_ROS2 = "/_action/"

_OWN_NAMES = {"/fmu/": "px4", "/ap/": "ardupilot"}
"""Beginnings of the names of an autopilot's own interface, and the names of a vehicle that has them."""
_WRITTEN = {"mavros": "MAVROS", "": "its SDK"}


@dataclass(slots=True)
class Want:
    """One name that one component uses in one way.

    Attributes:
        kind: One of the kinds above.
        name: Absolute name; of a transform, ``transform from <source> to <target>``.
        type: Type of the topic or service.
        who: Component that uses it.
        node: Its node.
        since: Time of the first use, ns.
        count: Messages without a taker, calls without a server, or transforms that were not there.
        met: Whether a node took or served it at any time.
        reason: Why those who were there did not match.
    """

    kind: str
    name: str
    type: str
    who: str
    node: str
    since: Ns
    count: int = 0
    met: bool = False
    reason: str = ""

    def note(self, met: bool) -> bool:
        """Note whether a node serves it now, and return that."""
        self.met = self.met or met
        return met


@dataclass(slots=True)
class Wants:
    """All wants of one graph, and the names of services that were served at any time, with their types."""

    entries: dict[tuple[str, str, str], Want] = field(default_factory=dict)
    served: dict[str, str] = field(default_factory=dict)

    def of(self, kind: str, name: str, type_name: str, user: tuple[str, str], now: Ns) -> Want:
        """Return the want of *user*, a component and its node, made at its first use."""
        who, node = user
        key = kind, name, who
        found = self.entries.get(key)
        if found is None:
            found = self.entries[key] = Want(kind, name, type_name, who, node, now)
        return found


@dataclass(frozen=True)
class KnownParticipants:
    """What a run knows beside the graph.

    Attributes:
        components: Components whose wants are reported: those of the model, not those of volery.
        vehicles: Whose names (``mavros``) the node of a vehicle has, by vehicle.
        without_node: Vehicles in no allocation, which no component commands through a port.
    """

    components: Collection[str]
    vehicles: Mapping[str, str] = field(default_factory=dict)
    without_node: Collection[str] = ()


def unserved(wants: Wants, around: KnownParticipants, now: Ns) -> list[Unserved]:
    """Return what no node took or served until *now*: requests before offers, then by time and name."""
    entries = list(wants.entries.values())
    merged: dict[tuple[str, str], list[Want]] = {}
    for want in entries:
        kind, name = _action_of(want) or (want.kind, want.name)
        if name and not _is_met(want, wants) and want.who in around.components:
            merged.setdefault((kind, name), []).append(want)
    found = [
        Unserved(
            now,
            kind,
            name,
            same[0].type,
            ", ".join(dict.fromkeys(want.node for want in same)),
            sum(want.count for want in same),
            min(want.since for want in same),
            next((want.reason for want in same if want.reason and _has_senders(want, wants)), "")
            or _near_miss(kind, name, same[0].type, wants, around),
        )
        for (kind, name), same in merged.items()
        if kind != PUBLISHED or any(want.count for want in same)
    ]
    return sorted(found, key=lambda one: (_ORDER.index(one.kind), not one.hint, one.since, one.name))


def _is_met(want: Want, wants: Wants) -> bool:
    if want.kind == SERVICE:
        return want.met or want.name in wants.served
    return want.met or (want.kind in (PUBLISHED, SUBSCRIBED) and want.name in NEED_NOBODY)


def _has_senders(want: Want, wants: Wants) -> bool:
    """Return whether there is anything that the reason of a want can be about."""
    return want.kind != TRANSFORM or any(
        kind == PUBLISHED and name in ("/tf", "/tf_static") for kind, name, _ in wants.entries
    )


def _action_of(want: Want) -> tuple[str, str] | None:
    """Return the action of a want, with an empty name if another want of the action stands for it.

    A server that no client calls waits rightly, like that of a service. So a client's side alone is named.
    """
    if _ACTION_OF_ROS2 in want.name:
        name, _, part = want.name.partition(_ACTION_OF_ROS2)
        return ACTION, name if part == "send_goal" else ""
    name, slash, part = want.name.rpartition("/")
    if slash + part in _ACTION_PARTS and want.type.endswith(_ACTION_TYPES):
        return ACTION, name if (part, want.kind) == ("goal", PUBLISHED) else ""
    return None


def _near_miss(kind: str, name: str, type_name: str, wants: Wants, around: KnownParticipants) -> str:
    """Return what is there instead and what to do, or an empty string."""
    other = PUBLISHED if kind == SUBSCRIBED else SUBSCRIBED
    for want in wants.entries.values():
        if (want.kind, want.name) == (other, name) and kind in (PUBLISHED, SUBSCRIBED):
            return f"{want.node} {'publishes' if kind == SUBSCRIBED else 'takes'} it with another QoS or type"
    for prefix, wanted in _OWN_NAMES.items():
        offered = any(names.partition("-")[0] == wanted for names in around.vehicles.values())
        if prefix in name and around.vehicles and not offered:
            listed = [
                f"{vehicle} has {_WRITTEN.get(names, names)}'s" for vehicle, names in around.vehicles.items()
            ]
            return f"a vehicle with 'names: {wanted}' offers such topics; {', '.join(listed[:3])}"
    if kind == TRANSFORM:
        return "no node publishes /tf"
    namespace = name.split("/")[1] if name.startswith("/") else ""
    if around.without_node and (namespace == "mavros" or namespace in around.without_node):
        vehicle = namespace if namespace in around.without_node else next(iter(around.without_node))
        return f"{vehicle} is in no allocation, so it has no MAVROS node"
    close = _closest(name, _counterparts(kind, name, type_name, wants))
    if not close and namespace == "mavros" and not around.vehicles:
        return "no vehicle of the model has a MAVROS node"
    return f"did you mean {close}?" if close else ""


def _counterparts(kind: str, name: str, type_name: str, wants: Wants) -> list[str]:
    """Return the names of the other side, those of the same type if there are any."""
    other = PUBLISHED if kind == SUBSCRIBED else SUBSCRIBED
    topics = [(entry.name, entry.type) for entry in wants.entries.values() if entry.kind == other]
    found: Iterable[tuple[str, str]] = topics if kind in (PUBLISHED, SUBSCRIBED) else wants.served.items()
    if kind == ACTION:
        end = _ACTION_OF_ROS2 + "send_goal" if type_name in wants.served.values() else "/goal"
        found = [(one.removesuffix(end), of) for one, of in (*found, *topics) if one.endswith(end)]
    return sorted({one for one, of in found if one != name and of == (type_name or of)})


def _closest(name: str, names: Collection[str]) -> str:
    """Return the name with the same end and the most common parts, else one of similar spelling."""
    parts = name.split("/")

    def common(other: str) -> int:
        theirs = other.split("/")
        same = 0
        while same < min(len(parts), len(theirs)) and parts[-1 - same] == theirs[-1 - same]:
            same += 1
        return same

    best = max(names, key=common, default="")
    if best and common(best):
        return best
    return next(iter(get_close_matches(name, list(names), n=1, cutoff=0.8)), "")
