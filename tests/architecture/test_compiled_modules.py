"""What mypyc compiles to something else without an error is kept out of the modules that it compiles."""

from __future__ import annotations

from types import ModuleType

import pytest


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("class A:\n    @cached_property\n    def x(self) -> int:\n        return 1\n", "at every access"),
        ("class A:\n    @property\n    def x(self) -> Record:\n        return f\n", "make it a method"),
        (
            "class A:\n    @property\n    def x(self) -> Callable[[], int]:\n        return f\n",
            "make it a method",
        ),
        ("@dataclass(frozen=True, slots=True)\nclass A:\n    x: int\n", "slots=True"),
        ("x = 1\ny = 2\ndef f(x: int) -> int:\n    return f(x - 1)\n", "no limit"),
        ("class A:\n    x = 1\n    def f(self) -> int:\n        return self.f()\n", "no limit"),
        ("x = eval('y')\n", "eval without names"),
        ("x = sys._getframe(2)\n", "no frame"),
    ],
)
def test_each_trap_is_named_with_its_line(script: ModuleType, source: str, reason: str) -> None:
    [(line, found)] = script.uncompilable(source, frozenset({"Record"}))
    assert reason in found
    assert line == (3 if "def" in source else 1)


def test_an_attribute_that_a_plain_subclass_may_set_is_named(script: ModuleType) -> None:
    open_class = "@mypyc_attr(allow_interpreted_subclasses=True)\nclass A:\n    slow: bool = False\n"
    [(line, found)] = script.uncompilable(open_class)
    assert "not read" in found
    assert line == 3
    without_value = open_class.replace(" = False", "")
    assert list(script.uncompilable(without_value)) == []


def test_harmless_relatives_pass(script: ModuleType) -> None:
    harmless = (
        "class A:\n    @property\n    def x(self) -> int:\n        return eval('1', {})\n"
        "@dataclass(frozen=True)\nclass B:\n    x: int\n"
        "class C:\n    def outer(self) -> Record:\n        return outer()\n"
        "def outer() -> Record:\n    return sys._getframe().f_back\n"
    )
    assert list(script.uncompilable(harmless, frozenset({"Record"}))) == []


def test_no_module_that_is_compiled_has_one(script: ModuleType) -> None:
    assert list(script.compiled_modules()) == []


@pytest.mark.parametrize(
    ("statement", "compiled"),
    [
        ("LIMIT = 3  # of a list", "LIMIT: _Final = 3  # of a list"),
        ("LIMIT: int = f()", "LIMIT: _Final[int] = f()"),
        ("LOW, _HIGH = 1, 2.5", "LOW: _Final = 1; _HIGH: _Final = 2.5"),
        ("NAMES = {'µ': 1}\nLIMIT = 3", "NAMES: _Final = {'µ': 1}\nLIMIT: _Final = 3"),
        ("POINT = (1.0, 2.0)", None),
        ("POINT: Vector = (nan, nan)", None),
        ("LIMIT: Final = 3", None),
        ("LIMIT = 3\nLIMIT = 4", None),
        ("LIMIT = 3\ndef f() -> None:\n    global LIMIT", None),
        ("T = TypeVar('T')\nlimit = 3", None),
    ],
)
def test_a_constant_is_final_in_what_is_compiled(compiler, statement, compiled):
    future = "from __future__ import annotations"
    found = compiler.with_final_constants(f"{future}\n{statement}\n")
    assert found == f"{future}; from typing import Final as _Final\n{compiled or statement}\n"
