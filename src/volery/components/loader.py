"""Import of a component's file and of the modules beside it, for one run.

Files are executed as they are, with three differences that the file cannot see. Modules that depend on the
run (``time``, ``random``, ``queue``, ``threading``, ``rospy`` and so on) are replaced, for these files only.
Modules beside the component's file are loaded in the same way. Where code is counted, counters are compiled
in. Nothing global is changed: patching ``sys.modules`` would affect the simulation itself.

Each instance executes its own copy of the component's file, as its own process would. Modules beside it are
executed once a run, so that all components see the same classes: types that components exchange belong into
a file of their own.
"""

from __future__ import annotations

import ast
import builtins
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from volery.base.errors import ComponentError, Location, ModelError
from volery.components.instance import COMPONENT_MARK, describe
from volery.cost import StepCounter

_PREFIX = "volery.user"
USER_MODULE_PREFIX = f"{_PREFIX}."
"""Prefix of the names of all modules of components."""
SHARED_MODULE_PREFIX = f"{_PREFIX}.shared."
"""Prefix of the modules that components share: those beside their files."""
FRAMEWORK_PACKAGE = "volery"
COMPUTING_MODULES = {
    *("bz2", "csv", "decimal", "difflib", "fractions", "gzip", "hashlib", "hmac", "html", "json", "lzma"),
    *("marshal", "pickle", "re", "sqlite3", "statistics", "tarfile", "xml", "zipfile", "zlib"),
}
"""Modules of Python whose calls take a time that grows with their arguments: their code is not counted."""


@dataclass(frozen=True)
class SourceFile:
    """A component's file, parsed."""

    path: Path
    tree: ast.Module

    def class_names(self) -> list[str]:
        """Return the classes (and other names) that the file defines or imports at top level."""
        names = [node.name for node in self.tree.body if isinstance(node, ast.ClassDef)]
        for node in self.tree.body:
            if isinstance(node, ast.ImportFrom):
                names += [alias.asname or alias.name for alias in node.names]
        return names

    def is_script(self) -> bool:
        """Return whether the file has an ``if __name__ == "__main__":`` at top level."""
        tests = (node.test for node in self.tree.body if isinstance(node, ast.If))
        return any("__main__" in ast.unparse(test) for test in tests)

    def line_of(self, class_name: str, method: str = "") -> int:
        """Return the line of a top-level class or of its method; 1 if the file does not contain it."""
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef) and node.name == class_name:
                inside = (
                    item for item in node.body if isinstance(item, ast.FunctionDef) and item.name == method
                )
                return next((item.lineno for item in inside), node.lineno)
        return 1


def not_python(path: Path, error: SyntaxError) -> ModelError:
    """Return the error of the user's file, with the line that Python's compiler names."""
    return ModelError(f"not Python: {error.msg}", where=Location(str(path), error.lineno or 1))


TOO_DEEP = "an expression is nested too deeply to be compiled; split it into several"


def parse(path: Path, where: Location | None = None) -> SourceFile:
    """Parse a component's file.

    Args:
        path: The file.
        where: Line of the model that names it, for error messages.

    Raises:
        ModelError: The file is missing, is not Python or is nested too deeply.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ModelError(f"no file {path}", where=where) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path} cannot be read: {error}", where=where) from error
    try:
        return SourceFile(path, ast.parse(text, filename=str(path)))
    except SyntaxError as error:
        raise not_python(path, error) from error
    except ValueError as error:
        raise ModelError(f"not Python: {error}", where=Location(str(path), 1)) from error
    except RecursionError as error:
        raise ModelError(TOO_DEEP, where=Location(str(path), 1)) from error


def imported_files(path: Path) -> tuple[Path, ...]:
    """Return a component's file and the files beside it that it imports, directly or through others.

    All Python files of a package count, and all beside a file that imports by names made while it runs.

    Raises:
        ModelError: A file is not Python.
    """
    found: dict[Path, None] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found[file] = None
            waiting += _imports_of(file)
    return tuple(found)


def _imports_of(file: Path) -> Iterator[Path]:
    for node in ast.walk(parse(file).tree):
        if isinstance(node, ast.Import):
            names = [(file.parent, one.name) for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            folder = file.parents[node.level - 1] if node.level else file.parent
            below = [f"{node.module}.{one.name}" if node.module else one.name for one in node.names]
            names = [(folder, name) for name in (node.module, *below) if name]
        elif isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node) in _DYNAMIC_IMPORTS:
            yield from sorted(file.parent.glob("*.py"))
            continue
        else:
            continue
        for folder, name in names:
            yield from _module_files(folder, name)


_DYNAMIC_IMPORTS = ("__import__", "importlib.import_module", "import_module")


def _module_files(folder: Path, name: str) -> Iterator[Path]:
    """Yield the files of the module or package *name* (dotted) in *folder*, if it is there."""
    top = folder / name.partition(".")[0]
    if top.is_dir():
        yield from sorted(top.rglob("*.py"))
    elif (module := top.with_name(f"{top.name}.py")).is_file():
        yield module


@dataclass
class Loader:
    """Loads the files of one run.

    Attributes:
        replacements: Modules that are imported in place of others, by dotted name.
        steps: Counter of the code, or None where code is not counted.
        libraries: Top-level names of imported libraries whose code is not counted: those outside Python's
            own, and ``COMPUTING_MODULES``.
    """

    replacements: Mapping[str, ModuleType] = field(default_factory=dict)
    steps: StepCounter | None = None
    libraries: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._codes: dict[Path, CodeType] = {}
        self._shared: dict[Path, ModuleType] = {}

    def load(self, source: SourceFile, name: str, as_main: bool = False) -> ModuleType:
        """Execute a component's file for the instance ``name`` and return its module.

        Args:
            source: The file.
            name: Name of the instance.
            as_main: Execute it with ``__name__ == "__main__"``, as a script, which may block.

        Raises:
            ComponentError: The file raises an exception, unless it is executed ``as_main``.
        """
        full_name = f"{_PREFIX}.{name}.{source.path.stem}"
        code = self._compile(source)
        module = self._module(full_name, source.path)
        if as_main:
            module.__name__ = "__main__"
            exec(code, module.__dict__)
            return module
        self._execute(code, module, name)
        return module

    def _module(self, full_name: str, path: Path) -> ModuleType:
        module = ModuleType(full_name)
        module.__file__ = str(path)
        module.__dict__[COMPONENT_MARK] = True
        module.__dict__["__builtins__"] = self._builtins(path.parent)
        if self.steps:
            module.__dict__.update(self.steps.names())
        sys.modules[full_name] = module  # dataclasses and typing look a class's module up there
        return module

    def _compile(self, source: SourceFile) -> CodeType:
        code = self._codes.get(source.path)
        if code is None:
            try:
                tree = self.steps.instrument(source.tree) if self.steps else source.tree
                code = compile(tree, str(source.path), "exec", dont_inherit=True)
            except SyntaxError as error:  # such as a return outside a function: its tree can be made
                raise not_python(source.path, error) from error
            except RecursionError as error:
                raise ModelError(TOO_DEEP, where=Location(str(source.path), 1)) from error
            self._codes[source.path] = code
        return code

    def _execute(self, code: CodeType, module: ModuleType, name: str) -> None:
        try:
            exec(code, module.__dict__)
        except Exception as error:
            raise ComponentError(name, f"{module.__file__} cannot be loaded: {describe(error)}") from error
        finally:
            if self.steps:
                self.steps.take()  # loading is not charged

    def _builtins(self, folder: Path) -> dict[str, Any]:
        names = vars(self.replacements.get("builtins", builtins))
        return {**names, "__import__": _Import(self, folder)}

    def sibling(self, name: str, folder: Path) -> ModuleType | None:
        """Return the module or package ``name`` (dotted) beside the importing file, or None."""
        base = folder.joinpath(*name.split("."))
        for path in (base.with_name(base.name + ".py"), base / "__init__.py"):
            if path.is_file():
                return self._load_shared(path, name)
        return None

    def _load_shared(self, path: Path, name: str) -> ModuleType:
        known = self._shared.get(path)
        if known is not None:
            return known
        code = self._compile(parse(path))
        module = self._module(f"{SHARED_MODULE_PREFIX}{name}", path)
        if path.name == "__init__.py":
            module.__path__ = [str(path.parent)]
        self._shared[path] = module  # before it runs, as Python does: modules may import each other
        try:
            self._execute(code, module, name)
        except BaseException:
            del self._shared[path]
            raise
        return module


class _Import:
    """``__import__`` for the files in one folder."""

    def __init__(self, loader: Loader, folder: Path) -> None:
        self._loader = loader
        self._folder = folder

    def __call__(
        self,
        name: str,
        globals_: Mapping[str, Any] | None = None,
        locals_: Mapping[str, Any] | None = None,
        fromlist: tuple[str, ...] | None = (),
        level: int = 0,
    ) -> ModuleType:
        if level:
            return self._relative(name, fromlist or (), level)
        found = self._find(name)
        if found is None:
            return self._real(name, globals_, fromlist)
        if fromlist:
            self._submodules(found, name, fromlist)
            return found
        return self._top_of(name, found)

    def _find(self, name: str) -> ModuleType | None:
        return self._loader.replacements.get(name) or self._loader.sibling(name, self._folder)

    def _real(
        self, name: str, globals_: Mapping[str, Any] | None, fromlist: tuple[str, ...] | None
    ) -> ModuleType:
        module = builtins.__import__(name, globals_, None, fromlist or ())
        top = name.partition(".")[0]
        if top in COMPUTING_MODULES or (top not in sys.stdlib_module_names and top != FRAMEWORK_PACKAGE):
            self._loader.libraries.add(top)
        return module

    def _submodules(self, package: ModuleType, name: str, wanted: tuple[str, ...]) -> None:
        """Load the modules of ``from package import module`` before the names are looked up."""
        for attribute in wanted:
            if attribute == "*" or attribute in vars(package):
                continue
            module = self._find(f"{name}.{attribute}")
            if module is not None:
                setattr(package, attribute, module)
                continue
            try:
                getattr(package, attribute)
            except AttributeError as error:
                raise ImportError(str(error)) from None

    def _top_of(self, name: str, found: ModuleType) -> ModuleType:
        """Return the module ``a`` for ``import a.b.c``, with ``b.c`` as its attribute."""
        parts = name.split(".")
        module = found
        for length in range(len(parts) - 1, 0, -1):
            parent = self._find(".".join(parts[:length])) or ModuleType(".".join(parts[:length]))
            setattr(parent, parts[length], module)
            module = parent
        return module

    def _relative(self, name: str, fromlist: tuple[str, ...], level: int) -> ModuleType:
        """Import ``from .name import a`` and ``from . import a``, ``level - 1`` folders above the file."""
        folder = self._folder
        for _ in range(level - 1):
            folder = folder.parent
        package = self._loader.sibling(name or "__init__", folder)
        if package is None and name:
            raise ImportError(f"no module {'.' * level}{name} in {folder}")
        found = package or ModuleType(folder.name)
        for attribute in fromlist:
            module = self._loader.sibling(f"{name}.{attribute}" if name else attribute, folder)
            if module is not None and attribute not in vars(found):
                setattr(found, attribute, module)
        return found
