"""What is known of frames: a tree of transforms over time, asked as tf2 is."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterator
from typing import NamedTuple

from volery.base.time import Ns, S, to_seconds
from volery.ros.client_libraries.tf2.errors import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
)
from volery.ros.client_libraries.tf2.geometry import IDENTITY, Rigid, between, normal

LATEST: Ns = 0
"""The time that stands for the latest at which all is known."""
_CACHE: Ns = 10 * S


class _Sample(NamedTuple):
    at: Ns
    parent: str
    rigid: Rigid


class Tree:
    """Frames and their parents.

    What is older than *cache* before a frame's newest is forgotten; a static transform holds at all times.
    """

    def __init__(self, cache: Ns = _CACHE) -> None:
        self._cache = cache
        self._moving: dict[str, list[_Sample]] = {}
        self._static: dict[str, _Sample] = {}
        self._parents: dict[str, None] = {}

    def clear(self) -> None:
        """Forget what moves."""
        self._moving.clear()

    def frames(self) -> list[str]:
        """All that have been told of, sorted."""
        return sorted({*self._parents, *self._moving, *self._static})

    def learn(self, child: str, parent: str, at: Ns, rigid: Rigid, *, static: bool = False) -> None:
        """Where *child* lies in *parent* at a time. ``InvalidArgumentException`` for what is no transform."""
        rotation = normal(rigid.rotation)
        problem = _problem(child, parent) or ("" if rotation else "its rotation has no length")
        if problem or rotation is None:
            raise InvalidArgumentException(f"transform from {child!r} to {parent!r} ignored: {problem}")
        sample = _Sample(at, parent, Rigid(rotation, rigid.translation))
        self._parents[parent] = None
        if static:
            self._static[child] = sample
            return
        history = self._moving.setdefault(child, [])
        if history and at < history[-1].at - self._cache:
            return
        history[:] = [one for one in history if one.at != at]
        insort(history, sample, key=_time)
        del history[: bisect_left(history, history[-1].at - self._cache, key=_time)]

    def look_up(self, target: str, source: str, at: Ns) -> tuple[Ns, Rigid]:
        """What takes a point of *source* to *target*, and the time that it holds for.

        Raises what tf2 does: ``LookupException``, ``ConnectivityException``, ``ExtrapolationException``.
        """
        known = self.frames()
        for name, role in ((target, "target_frame"), (source, "source_frame")):
            if name not in known:
                raise LookupException(
                    f'"{name}" passed to lookupTransform argument {role} does not exist. '
                    f"There is {', '.join(known) or 'none'}"
                )
        up, down = self._ways(target, source)
        if at == LATEST:
            at = self._latest([*up, *down])
        try:
            there, back = self._along(up, at), self._along(down, at)
        except ExtrapolationException as error:
            raise ExtrapolationException(
                f"{error}, when looking up transform from frame [{source}] to frame [{target}]"
            ) from None
        return at, there.then(back.inverse())

    def _ways(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """The frames below the first common one, from the source and from the target."""
        from_source, from_target = list(self._upward(source)), list(self._upward(target))
        common = next((frame for frame in from_source if frame in from_target), None)
        if common is None:
            raise ConnectivityException(
                f"Could not find a connection between '{target}' and '{source}' because they are not part of "
                f"the same tree. Tf has two or more unconnected trees."
            )
        return from_source[: from_source.index(common)], from_target[: from_target.index(common)]

    def _upward(self, frame: str) -> Iterator[str]:
        seen: set[str] = set()
        while frame not in seen:
            seen.add(frame)
            yield frame
            newest = self._newest(frame)
            if newest is None:
                return
            frame = newest.parent

    def _newest(self, frame: str) -> _Sample | None:
        history = self._moving.get(frame)
        return history[-1] if history else self._static.get(frame)

    def _latest(self, way: list[str]) -> Ns:
        """The latest time for which all that moves on the way is known."""
        moving = [self._moving[frame][-1].at for frame in way if self._moving.get(frame)]
        return min(moving, default=LATEST)

    def _along(self, way: list[str], at: Ns) -> Rigid:
        found = IDENTITY
        for frame in way:
            found = found.then(self._at(frame, at))
        return found

    def _at(self, frame: str, at: Ns) -> Rigid:
        history = self._moving.get(frame)
        if not history:
            return self._static[frame].rigid
        after = bisect_left(history, at, key=_time)
        if after < len(history) and history[after].at == at:
            return history[after].rigid
        if after == len(history):
            raise _beyond(at, history[-1].at, "future", "latest")
        if after == 0:
            raise _beyond(at, history[0].at, "past", "earliest")
        one, other = history[after - 1], history[after]
        return between(one.rigid, other.rigid, (at - one.at) / (other.at - one.at))


def _time(sample: _Sample) -> Ns:
    return sample.at


def _beyond(asked: Ns, known: Ns, direction: str, which: str) -> ExtrapolationException:
    return ExtrapolationException(
        f"Lookup would require extrapolation into the {direction}.  Requested time {to_seconds(asked):.6f} "
        f"but the {which} data is at time {to_seconds(known):.6f}"
    )


def _problem(child: str, parent: str) -> str:
    if not child or not parent:
        return "a frame without a name"
    if child == parent:
        return "a frame cannot be its own parent"
    if child.startswith("/") or parent.startswith("/"):
        return "tf2 frame_ids cannot start with a '/'"
    return ""
