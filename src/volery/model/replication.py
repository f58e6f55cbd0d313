"""A number of vehicles: ``count: N`` of a vehicle ``drone`` makes ``drone_1`` to ``drone_N``.

What belongs to the vehicle is replicated with it: an entry that names it, or names something that belongs to
it, where one name stands (a port that takes one, ``carried_by``, ``observe`` …), or that says ``per: drone``.
Where a list of names stands (a port that takes many, the ends of a network), all copies stand in it. An entry
that is called like a copy states what differs in that copy; without such a copy it is left out.

All this happens in the tree, before it is read: everything else sees the copies only. Their values keep their
lines, and problems at a copy are reported at the entry that it was made of.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, field, replace

from volery.base import units
from volery.base.units import QuantityError
from volery.model import rules
from volery.model.document import short_key
from volery.model.environment import MOST_COPIES
from volery.model.fields import entries, shown
from volery.model.instances import Instance
from volery.model.text import Path, Problems, TextNode, no_such, written

_VEHICLES: Path = ("environment", "vehicles")
_PLACES: Path = ("environment", "places")
_INSTANCES: tuple[Path, ...] = (("application",), ("environment", "components"))
_SOFTWARE: tuple[Path, ...] = (("memory_spaces",), ("platform", "operating_systems"))
_NAMING: dict[Path, tuple[str, ...]] = {
    _VEHICLES: (),
    _PLACES: ("place",),
    ("application",): (),
    ("environment", "components"): (),
    ("platform", "processors"): ("carried_by", "powered_by"),
    ("platform", "networks"): (),
    ("platform", "devices"): ("on", "bus"),
    ("platform", "operating_systems"): (),
    ("memory_spaces",): (),
    ("environment", "faults"): ("vehicle", "processor", "network"),
    ("requirements",): ("observe",),
    ("chains",): (),
}
"""The sections whose entries are replicated, and their keys where one name stands, beside `per` and ports."""

_INSTANCE_KEYS = {entry.key for entry in entries(Instance) if not entry.others}
_TEXTS = ("namespace", "remap", "arguments", "parameters", "node_name")
"""Keys of an instance in which names of what belongs to the vehicle become those of the copy."""

_NUMBER: tuple[Path, ...] = (("count",), ("spacing",))
_SPACING_M = {"east": 3.0, "north": 0.0}


def is_counted(root: TextNode) -> bool:
    """Return whether a vehicle has a ``count``."""
    vehicles = root.at(_VEHICLES)
    return any(node.child("count") is not None for node in (vehicles.items.values() if vehicles else ()))


def is_called_like_copy(name: str, of: Container[str]) -> bool:
    """Return whether a name is that of a copy of something, whatever its number."""
    base, _, number = name.rpartition("_")
    return number.isdigit() and base in of


def leads_to_copy(root: TextNode, path: Path) -> bool:
    """Return whether *path* leads through an entry that is not there and is called like a copy."""
    node = root
    for step in path:
        below = node.child(step)
        if below is None:
            return is_called_like_copy(str(step), node.items)
        node = below
    return False


def replicate(root: TextNode, places: dict[str, TextNode] | None, problems: Problems) -> TextNode:
    """Return the tree with every vehicle that has a ``count`` replaced by its copies.

    Args:
        root: The tree as it is stated; it stays as it is.
        places: The selected allocation; changed in place.
        problems: Where problems are reported.
    """
    counts = dict(_counts(root, problems))
    if not counts:
        return root
    spacings = {name: _spacing(root, name, problems) for name in counts}
    replication = _Replication(root.copy(), problems, counts, spacings)
    replication.find_members()
    replication.make_copies()
    for name, allocation in replication.entries_of("allocations"):
        replication.check_places(name, allocation.items)
        if isinstance(allocation.value, dict):
            allocation.value = replication.placed(allocation.items)
    for _, changed in (*replication.entries_of("scenarios"), *replication.entries_of("allocations")):
        changes = changed.child("set")
        if changes is not None and isinstance(changes.value, dict):
            changes.value = {
                path: one for key, one in changes.items.items() for path in replication.paths_of_copies(key)
            }
    if places is not None:
        replaced = replication.placed(places)
        places.clear()
        places.update(replaced)
    return replication.root


def _counts(root: TextNode, problems: Problems) -> Iterator[tuple[str, int]]:
    vehicles = root.at(_VEHICLES)
    for name, node in vehicles.items.items() if vehicles else ():
        stated = node.child("count")
        if stated is None or stated.value is None:
            continue
        count = stated.value
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MOST_COPIES:
            what = f"a whole number from 1 to {MOST_COPIES} is expected, not {shown(stated)}"
            problems.add((*_VEHICLES, name, "count"), what, stated.where)
            count = 1
        yield name, count


def _spacing(root: TextNode, vehicle: str, problems: Problems) -> dict[str, float]:
    path = (*_VEHICLES, vehicle, "spacing")
    node = root.at(path)
    if node is None or node.value is None:
        return _SPACING_M
    if not isinstance(node.value, dict):
        problems.add(path, f"a mapping such as {{east: 3 m}} is expected, not {shown(node)}", node.where)
    found = dict.fromkeys(_SPACING_M, 0.0)
    for key, one in node.items.items():
        try:
            if key in found:
                found[key] = units.read(one.value, units.LENGTH)
            else:
                what = no_such(key, "key of a spacing", found)
                problems.add((*path, key), what, one.where, rules.UNKNOWN_KEY)
        except QuantityError as error:
            problems.add((*path, key), str(error), one.where, rules.WRONG_QUANTITY)
    return found


def _texts(node: TextNode | None) -> list[str]:
    """Return the texts of a value: of one, or of a list."""
    listed = node.value if node is not None and isinstance(node.value, list) else [node]
    return [one.value for one in listed if isinstance(one, TextNode) and isinstance(one.value, str)]


def _merged(own: TextNode, copy: TextNode, path: Path) -> TextNode:
    """Return a copy with what is stated for it alone on top."""
    key = short_key(path)
    if isinstance(own.value, dict) and key is not None and not isinstance(copy.value, dict):
        copy = TextNode({key: copy}, copy.where)
    if not isinstance(own.value, dict) or not isinstance(copy.value, dict):
        return own
    below = {
        name: _merged(node, copy.value[name], (*path, name)) if name in copy.value else node
        for name, node in own.items.items()
    }
    return TextNode({**copy.value, **below}, copy.where)


@dataclass
class _Replication:
    """The tree that is changed in place, and what belongs to which vehicle.

    ``owners`` has the vehicle of each entry that is replicated; ``things`` and ``places`` that of each name.
    """

    root: TextNode
    problems: Problems
    counts: dict[str, int]
    spacings: dict[str, dict[str, float]]
    owners: dict[tuple[Path, str], str] = field(default_factory=dict)
    things: dict[str, str] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)

    # -- what belongs to a vehicle

    def find_members(self) -> None:
        """Find what belongs to each vehicle; report what belongs to two."""
        for vehicle in self.counts:
            self._adopt(_VEHICLES, vehicle, vehicle)
        found = True
        while found:
            found = False
            for section, name, node in list(self._entries()):
                if (section, name) in self.owners:
                    continue
                owner = next(self._owners_of(section, name, node), None)
                if owner is not None:
                    self._adopt(section, name, owner)
                    found = True
        for section, name, node in self._entries():
            owner = self.owners.get((section, name))
            other = next((one for one in self._owners_of(section, name, node) if one != owner), None)
            if owner is not None and other is not None:
                what = (
                    f"there is one for each {owner}, and it names something of which there is one for each "
                    f"{other}: name one of the copies, such as {other}_1, or require a list"
                )
                self.problems.add((*section, name), what, node.where, rules.DOUBLY_CONNECTED)

    def entries_of(self, section: str) -> list[tuple[str, TextNode]]:
        """Return the entries of a section."""
        node = self.root.child(section)
        return list(node.items.items()) if node else []

    def _entries(self) -> Iterator[tuple[Path, str, TextNode]]:
        for section in _NAMING:
            node = self.root.at(section)
            for name, below in node.items.items() if node else ():
                yield section, name, below

    def _adopt(self, section: Path, name: str, vehicle: str) -> None:
        self.owners[section, name] = vehicle
        (self.places if section == _PLACES else self.things).setdefault(name, vehicle)

    def _owners_of(self, section: Path, name: str, node: TextNode) -> Iterator[str]:
        """Yield the vehicles that an entry belongs to: one, or none, in a model that is right."""
        stated = node.child("per")
        if stated is not None and section != _VEHICLES:
            yield from (text for text in _texts(stated) if text in self.counts)
        if section in (_VEHICLES, _PLACES):
            texts = _texts(node.child("at" if section == _VEHICLES else "place"))
            yield from (self.places[text] for text in texts if text in self.places)
        elif section == ("chains",):
            yield from self._of_things(_texts(node))
        elif section in _SOFTWARE:
            for _, allocation in self.entries_of("allocations"):
                yield from self._of_things(_texts(allocation.child(name)))
        else:
            for key in self._ports(node, many=False) if section in _INSTANCES else _NAMING[section]:
                yield from self._of_things(_texts(node.child(key)))

    def _of_things(self, texts: Iterable[str]) -> Iterator[str]:
        for text in texts:
            name = self._name_in(text)
            if name is not None:
                yield self.things[name]

    def _name_in(self, text: str) -> str | None:
        """Return the name in `NAME`, `NAME.port` or `/NAME/topic`, if that belongs to a vehicle."""
        name = text[1:].partition("/")[0] if text.startswith("/") else text.partition(".")[0]
        return name if name in self.things else None

    def _ports(self, node: TextNode, *, many: bool) -> list[str]:
        """Return the connected ports of an instance: those that take one provider, or those of many."""
        kind = node.child("is")
        requires = self.root.at(("components", str(kind.value), "requires")) if kind is not None else None
        listed = {
            port
            for port, interface in (requires.items if requires else {}).items()
            if isinstance(interface.value, str) and interface.value.endswith("[]")
        }
        return [key for key in node.items if key not in _INSTANCE_KEYS and (key in listed) is many]

    # -- the copies

    def make_copies(self) -> None:
        """Replace every entry that belongs to a vehicle by its copies, and complete all lists of names."""
        for section in _NAMING:
            node = self.root.at(section)
            if node is not None and isinstance(node.value, dict):
                node.value = dict(self._replicated(section, node.items))
        for around in ("roads", "corridors"):
            ways = self.root.at(("environment", around, "ways"))
            if ways is not None and isinstance(ways.value, list):
                ways.value = [copy for way in ways.value for copy in self._copies_of(way, self.places)]
        suppressed = self.root.child("suppress")
        if suppressed is not None and isinstance(suppressed.value, list):
            suppressed.value = [copy for one in suppressed.value for copy in self._suppressions(one)]

    def _replicated(self, section: Path, stated: dict[str, TextNode]) -> Iterator[tuple[str, TextNode]]:
        owned = {name: self.owners[section, name] for name in stated if (section, name) in self.owners}
        for name, node in stated.items():
            if name not in owned:
                if not is_called_like_copy(name, owned):
                    yield name, self._completed(section, node)
                continue
            for i in range(1, self.counts[owned[name]] + 1):
                called = f"{name}_{i}"
                copy = self._copy(section, node, owned[name], i).copy()
                own = stated.get(called)
                if own is None:
                    self.problems.copied((*section, called), (*section, name))
                else:
                    for key in copy.items.keys() - own.items.keys():
                        self.problems.copied((*section, called, key), (*section, name, key))
                    copy = _merged(self._completed(section, own), copy, (*section, called))
                yield called, copy

    def _copy(self, section: Path, node: TextNode, vehicle: str, i: int) -> TextNode:
        """Return the *i*-th copy of an entry."""
        if section == ("chains",):
            return self._renamed(node, vehicle, i)
        if section == _PLACES:
            below = {key: one for key, one in node.items.items() if key != "per"}
            return self._shifted(replace(node, value=below), vehicle, i, i - 1)
        copy = self._completed(section, node)
        if not isinstance(copy.value, dict):
            return copy
        keys: list[str] = ["per", *_NAMING[section], "between"]
        if section in _INSTANCES:
            keys = ["per", *self._ports(node, many=False), *_TEXTS]
        below = {
            key: self._renamed(one, vehicle, i) if key in keys else one for key, one in copy.items.items()
        }
        if section == ("platform", "networks") and "between" in node.items:
            below["between"] = self._renamed(node.items["between"], vehicle, i)
        if section == _VEHICLES:
            below = {key: one for key, one in below.items() if key not in ("count", "spacing")}
            if "at" in below:
                below["at"] = self._stand(below["at"], vehicle, i)
        return replace(copy, value=below)

    def _completed(self, section: Path, node: TextNode) -> TextNode:
        """Return an entry with all copies in its lists of names."""
        keys = self._ports(node, many=True) if section in _INSTANCES else []
        if section == ("platform", "networks"):
            keys = ["between"]
        below = {key: self._all(one) if key in keys else one for key, one in node.items.items()}
        return replace(node, value=below) if isinstance(node.value, dict) else node

    def _all(self, node: TextNode) -> TextNode:
        """Return a list of names with all copies in the place of what they are made of."""
        listed = node.value if isinstance(node.value, list) else [node]
        return TextNode([copy for one in listed for copy in self._copies_of(one, self.things)], node.where)

    def _copies_of(self, node: TextNode, known: dict[str, str]) -> list[TextNode]:
        """Return the copies of a value that names something of *known*; the value itself if it does not."""
        names = [text if known is self.places else self._name_in(text) for text in _texts(node)]
        vehicle = next((known[name] for name in names if name in known), None)
        if vehicle is None:
            return [node]
        return [self._renamed(node, vehicle, i, known) for i in range(1, self.counts[vehicle] + 1)]

    def _renamed(self, node: TextNode, vehicle: str, i: int, known: dict[str, str] | None = None) -> TextNode:
        """Return a value in which the names of what belongs to the vehicle are those of its *i*-th copy."""
        if isinstance(node.value, dict):
            below = {key: self._renamed(one, vehicle, i, known) for key, one in node.items.items()}
            return replace(node, value=below)
        if isinstance(node.value, list):
            return replace(node, value=[self._renamed(one, vehicle, i, known) for one in node.value])
        if not isinstance(node.value, str):
            return replace(node)
        name = node.value if known is self.places else self._name_in(node.value)
        if name is None or (self.things if known is None else known).get(name) != vehicle:
            return replace(node)
        start = 1 if node.value.startswith("/") else 0
        rest = node.value[start + len(name) :]
        return replace(node, value=f"{node.value[:start]}{name}_{i}{rest}")

    # -- where the copies stand

    def _stand(self, at: TextNode, vehicle: str, i: int) -> TextNode:
        """Return where the *i*-th copy stands: at the points of a list in turn, then beside them."""
        points = at.value if isinstance(at.value, list) and at.value else [at]
        return self._shifted(points[(i - 1) % len(points)], vehicle, i, (i - 1) // len(points))

    def _shifted(self, point: TextNode, vehicle: str, i: int, steps: int) -> TextNode:
        """Return a point, moved by *steps* times the spacing unless each copy has a place of its own."""
        named = point if isinstance(point.value, str) else point.child("place")
        if named is not None and self.places.get(str(named.value)) == vehicle:
            return self._renamed(point, vehicle, i, self.places)
        if steps == 0 or not isinstance(point.value, str | dict):
            return point
        below = dict(point.items) if isinstance(point.value, dict) else {"place": point}
        for key, step in self.spacings[vehicle].items():
            stated = below.get(key)
            try:
                start = units.read(stated.value, units.LENGTH) if stated is not None else 0.0
            except QuantityError:  # reported when the point is read
                continue
            if step:
                moved = f"{start + steps * step!r} m"
                below[key] = TextNode(moved, stated.where if stated is not None else point.where)
        return TextNode(below, point.where)

    # -- allocations and suppressions

    def check_places(self, allocation: str, places: dict[str, TextNode]) -> None:
        """Report what an allocation places, once, on something of which there are several."""
        for name, node in places.items():
            vehicle = self.things.get(str(node.value))
            if vehicle is not None and name not in self.things:
                what = (
                    f"there is one {node.value} for each {vehicle}: state `per: {vehicle}` in {name} to have "
                    f"as many, or name one of them, such as {node.value}_1"
                )
                self.problems.add(("allocations", allocation, name), what, node.where, rules.BROKEN_CHAIN)

    def placed(self, places: dict[str, TextNode]) -> dict[str, TextNode]:
        """Return an allocation in which the copies are placed, each on its own vehicle's computer."""
        found: dict[str, TextNode] = {}
        for name, node in places.items():
            vehicle = self.things.get(name)
            if vehicle is None:
                on = self.things.get(str(node.value))
                found[name] = node if on is None else replace(node, value=f"{node.value}_1")
                continue
            for i in range(1, self.counts[vehicle] + 1):
                if f"{name}_{i}" not in places:
                    found[f"{name}_{i}"] = self._renamed(node, vehicle, i)
        return found

    def paths_of_copies(self, text: str) -> list[str]:
        """Return a path as the copies have it; none for a number of vehicles, which is no part of a copy."""
        steps: Path = tuple(text.split("."))
        for (section, name), vehicle in self.owners.items():
            rest = steps[len(section) + 1 :]
            if steps[: len(section) + 1] == (*section, name):
                copies = range(1, self.counts[vehicle] + 1) if rest[:1] not in _NUMBER else ()
                return [written((*section, f"{name}_{i}", *rest)) for i in copies]
        return [text]

    def _suppressions(self, node: TextNode) -> list[TextNode]:
        at = node.child("at")
        paths = self.paths_of_copies(str(at.value)) if at is not None else []
        if at is None or not paths:
            return [node]
        return [replace(node, value={**node.items, "at": replace(at, value=path)}) for path in paths]
