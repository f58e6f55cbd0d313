"""What is asked for once after the first heartbeat, and again while no answer comes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from volery.base.time import Ns, S
from volery.links.parameter_values import from_bytes

ASK_AGAIN: Ns = 2 * S
TRIES = 5
"""What was not answered so often does not exist there: firmware does not answer for a parameter it lacks."""


class Inquiries:
    """``ask(name)`` is called for each of *names* until ``answered``. Look at it once a second."""

    def __init__(self, ask: Callable[[str], None]) -> None:
        self._ask = ask
        self._tries: dict[str, int] = {}
        self._asked: dict[str, Ns] = {}
        self._begun = False

    @property
    def settled(self) -> bool:
        """All were answered, or will not be."""
        return self._begun and not self._tries

    def begin(self, names: Sequence[str]) -> None:
        """Ask for these, from the next look on."""
        self._begun = True
        self._tries = dict.fromkeys(names, TRIES)

    def answered(self, name: str) -> None:
        """No need to ask again."""
        self._tries.pop(name, None)

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        for name, left in list(self._tries.items()):
            asked = self._asked.get(name)
            if asked is not None and now - asked < ASK_AGAIN:
                continue
            if not left:
                del self._tries[name]
                continue
            self._tries[name] = left - 1
            self._asked[name] = now
            self._ask(name)


def value_of(fields: Mapping[str, Any], bytewise: bool) -> float:
    """The value in a PARAM_VALUE. *bytewise*: whole numbers lie in the four bytes of the float, as in PX4."""
    value: float = fields["param_value"]
    return from_bytes(fields["param_type"], value) if bytewise else value
