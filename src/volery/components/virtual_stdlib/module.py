"""How a stand-in module is put together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any, ClassVar, NoReturn

from volery.base.errors import choices
from volery.base.time import Ns, from_seconds
from volery.kernel.api import Kernel


class KernelBound:
    """A class of a stand-in module: each run has a subclass of its own, bound to its kernel."""

    kernel: ClassVar[Kernel]


def bind(kernel: Kernel, kinds: Iterable[type[KernelBound]]) -> dict[str, Any]:
    """The subclasses of *kinds* for one run, by name."""
    return {kind.__name__: type(kind.__name__, (kind,), {"kernel": kernel}) for kind in kinds}


def make_module(name: str, names: Mapping[str, Any]) -> ModuleType:
    """A module called *name* that offers exactly *names*, and says so when asked for more."""
    module = ModuleType(name, f"Stands in for {name} in the files of a run's components.")
    module.__dict__.update(names)

    def missing(attribute: str) -> NoReturn:
        raise AttributeError(
            f"{name}.{attribute} is not available in the files of components, where time is the run's; "
            f"there is {choices(key for key in names if not key.startswith('_'))}"
        )

    module.__dict__["__getattr__"] = missing
    return module


def within(blocking: bool, timeout: float | None) -> Ns | None:
    """How long to wait: ``None`` for ever, as without a *timeout* or with the -1 of ``Lock.acquire``."""
    if not blocking:
        return 0
    return None if timeout is None or timeout < 0 else from_seconds(timeout)
