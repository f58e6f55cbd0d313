"""Import of a component's file and of the modules that it imports, for one run.

Files are executed as they are, with three differences that the file cannot see. Modules that depend on the
run (``time``, ``random``, ``queue``, ``threading``, ``rospy`` and so on) are replaced, for these files only.
Modules of components are loaded in the same way. Where code is counted, counters are compiled in. Nothing
global is changed: patching ``sys.modules`` would affect the simulation itself.

Modules live in a ``Space``. Plain components share one: each instance executes its own copy of the
component's file, and the modules beside it are executed once a run, so that all components see the same
classes: types that components exchange belong into a file of their own. A script is a process of its own,
with its own copies of all modules. It finds them where Python and ROS do: beside the script, in its package,
in the workspace, and on ``PYTHONPATH``. A client library or an interface package is never a real one,
whatever is installed.
"""

from __future__ import annotations

import ast
import builtins
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from volery.base.errors import ComponentError, Location, ModelError, did_you_mean
from volery.components.instance import COMPONENT_MARK, RunningInstance, describe
from volery.components.polling import Polling, empty_turns, has_busy_loop
from volery.components.virtual_stdlib.process_modules import ProcessModules
from volery.cost import StepCounter
from volery.kernel.task import ExecutionContext
from volery.ros.messages import Library, Workspace, define_packages, modules
from volery.ros.messages.packages import KINDS
from volery.ros.messages.workspace import module_file

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


_DEFINITIONS = (
    *(
        ast.FunctionDef,
        ast.AsyncFunctionDef,
        ast.ClassDef,
        ast.Import,
        ast.ImportFrom,
        ast.Assign,
        ast.AnnAssign,
    ),
    *(ast.Try, ast.Pass),
)
"""Statements of a file that does nothing when it is executed. ``try`` is for imports."""
_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_STARTS = ("init", "init_node")
"""Functions of rclpy and rospy that a process calls once, at its start."""


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

    def defines(self, function: str) -> bool:
        """Return whether the file defines or imports a function (or another name) at top level."""
        return function in self.class_names() or any(
            isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name == function
            for node in self.tree.body
        )

    def starts_node(self) -> bool:
        """Return whether the top level itself starts a ROS node: ``rclpy.init()``, ``rospy.init_node(…)``."""
        acting = (node for node in self.tree.body if not isinstance(node, _SCOPES))
        calls = (call for node in acting for call in ast.walk(node) if isinstance(call, ast.Call))
        return any(ast.unparse(call.func).rpartition(".")[2] in _STARTS for call in calls)

    def only_defines(self, function: str) -> bool:
        """Return whether the file defines a function, and its top level calls nothing for its effect."""
        defined = any(isinstance(node, ast.FunctionDef) and node.name == function for node in self.tree.body)
        return defined and all(
            isinstance(node, _DEFINITIONS)
            or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
            for node in self.tree.body
        )

    def line_of(self, class_name: str, method: str = "") -> int:
        """Return the line of a top-level class or of its method; 1 if the file does not contain it."""
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef) and node.name == class_name:
                inside = (
                    item for item in node.body if isinstance(item, ast.FunctionDef) and item.name == method
                )
                return next((item.lineno for item in inside), node.lineno)
        return 1


_PYTHON_2 = (
    (r"call to 'print'|'print' is an invalid", r"", "a print statement"),
    (r"call to 'exec'", r"", "an exec statement"),
    (r"multiple exception types", r"", "'except A, e'"),
    (r"", r"^\s*except\b[^:(]+,\s*\w+\s*:", "'except A, e'"),
    (r"", r"^\s*raise\s+[\w.]+\s*,", "'raise A, text'"),
    (r"leading zeros|invalid decimal literal", r"\b(0[0-7]+|\d+[lL])\b", "a number as Python 2 writes it"),
    (r"invalid syntax", r"<>", "the operator <>"),
    (r"invalid syntax", r"`", "a backtick"),
    (r"invalid syntax", r"^\s*print\s+[^=(\s]", "a print statement"),
    (
        r"inconsistent use of tabs|unindent does not match|unexpected indent",
        r"\t",
        "indented by tabs and spaces",
    ),
)
"""What only Python 2 takes: the words of Python's compiler, the line, and how a message calls it."""


def not_python(path: Path, error: SyntaxError) -> ModelError:
    """Return the error of the user's file, with the line that Python's compiler names."""
    line = error.lineno or 1
    words, text = error.msg or "", _line_of(path, line)
    for said, written, name in _PYTHON_2:
        if re.search(said, words) and re.search(written, text):
            what = f"Python 2: line {line} is {name}; convert it with 2to3"
            return ModelError(what, where=Location(str(path), line))
    return ModelError(f"not Python: {words}", where=Location(str(path), line))


def _line_of(path: Path, line: int) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()[line - 1]
    except (OSError, IndexError):
        return ""


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
        text = path.read_bytes()  # Python itself reads a byte-order mark and a declared encoding
    except FileNotFoundError as error:
        raise ModelError(f"no file {path}", where=where) from error
    except OSError as error:
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


def imported_names(file: Path) -> set[str]:
    """Return the top-level modules that a file imports by absolute names.

    Raises:
        ModelError: The file is not Python.
    """
    found: set[str] = set()
    for node in ast.walk(parse(file).tree):
        if isinstance(node, ast.Import):
            found.update(name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    return found


def _imports_of(file: Path) -> Iterator[Path]:
    for node in ast.walk(parse(file).tree):
        if isinstance(node, ast.Import):
            names = [(file.parent, name.name) for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            folder = file.parents[node.level - 1] if node.level else file.parent
            below = [f"{node.module}.{name.name}" if node.module else name.name for name in node.names]
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


class ScriptHost:
    """What a script reaches of its run when it ends. This one reaches nothing."""

    def at_end(self, context: ExecutionContext, last: Callable[[], object]) -> None:
        """Call *last* in *context* when the component or the run ends."""

    def leave(self, component: str) -> None:
        """Call what is left to be called of a component whose script has ended, and remove it from the run.

        Called in the script's flow of control.
        """

    def kill(self, component: str) -> None:
        """Remove a component from the run at once."""


@dataclass
class Loader:
    """Loads the files of one run.

    Attributes:
        replacements: Modules that are imported in place of others, by dotted name. Interface packages are
            added when they are first imported.
        steps: Counter of the code, or None where code is not counted.
        polling: What lets time pass in loops that poll, or None on the wall clock.
        libraries: Top-level names of imported libraries whose code is not counted: those outside Python's
            own, and ``COMPUTING_MODULES``.
        workspace: The packages that scripts can import.
        host: What a script reaches of the run by its end.
    """

    replacements: MutableMapping[str, ModuleType] = field(default_factory=dict)
    steps: StepCounter | None = None
    polling: Polling | None = None
    libraries: set[str] = field(default_factory=set)
    workspace: Workspace = field(default_factory=Workspace)
    host: ScriptHost = field(default_factory=ScriptHost)

    def __post_init__(self) -> None:
        self._codes: dict[Path, CodeType] = {}
        self._interfaces: dict[Library, dict[str, ModuleType]] = {}
        self.searched: set[tuple[str, Path]] = set()
        """Interface packages that were searched for the files of a folder."""
        self.shared = Space(self, SHARED_MODULE_PREFIX)

    def interfaces(self, library: Library) -> dict[str, ModuleType]:
        """Return the interface packages with the classes of a client library; none for plain components."""
        if library and library not in self._interfaces:
            self._interfaces[library] = modules(library=library)
        return self._interfaces.get(library, {})

    def add_interfaces(self, package: str) -> None:
        """Make the interfaces of a package, which have been defined, importable."""
        made = modules(package)
        self.replacements.update(
            {name: one for name, one in made.items() if not _is_library(name, self.replacements.get(name))}
        )
        for library, known in self._interfaces.items():
            known.update(modules(package, library))

    def load(self, source: SourceFile, name: str, library: Library = "") -> ModuleType:
        """Execute a component's file for the instance ``name`` and return its module.

        Raises:
            ComponentError: The file raises an exception.
        """
        module = self.shared.module(f"{USER_MODULE_PREFIX}{name}.{source.path.stem}", source.path, library)
        try:
            self.execute(source, module)
        except (ModelError, ComponentError):
            raise
        except Exception as error:
            raise ComponentError(name, f"{module.__file__} cannot be loaded: {describe(error)}") from error
        return module

    def execute(self, source: SourceFile, module: ModuleType) -> None:
        """Execute a file in its module; loading is not charged."""
        code = self.compile(source, module)
        try:
            exec(code, module.__dict__)
        finally:
            if self.steps:
                self.steps.take()

    def compile(self, source: SourceFile, module: ModuleType) -> CodeType:
        """Return the code of a file, to be executed in its module; with counters if code is counted."""
        code = self._codes.get(source.path)
        if code is None:
            try:
                empty = empty_turns(source.tree)
                steps = self._counter_of(source.tree)
                tree = steps.instrument(source.tree) if steps else source.tree
                tree = self.polling.instrument(tree, source.path, empty) if self.polling else tree
                code = compile(tree, str(source.path), "exec", dont_inherit=True)
            except SyntaxError as error:  # such as a return outside a function: its tree can be made
                raise not_python(source.path, error) from error
            except RecursionError as error:
                raise ModelError(TOO_DEEP, where=Location(str(source.path), 1)) from error
            self._codes[source.path] = code
        if self.steps:
            module.__dict__.update(self.steps.names())
        if self.polling:
            module.__dict__.update(self.polling.names())
        return code

    def _counter_of(self, tree: ast.Module) -> StepCounter | None:
        if self.steps or self.polling is None or not has_busy_loop(tree):
            return self.steps
        return self.polling.steps

    def sibling(self, name: str, folder: Path) -> ModuleType | None:
        """Return the shared module or package ``name`` (dotted) in *folder*, or None."""
        return self.shared.find(name, folder)


class Space:
    """Modules that are executed once, for one process or for all plain components.

    Args:
        loader: The run's loader.
        prefix: Prefix of the modules' names.
        library: Client library whose messages the modules get.
    """

    def __init__(self, loader: Loader, prefix: str, library: Library = "") -> None:
        self.loader = loader
        self.library: Library = library
        self._prefix = prefix
        self._modules: dict[Path, ModuleType] = {}

    def replaced(self, name: str) -> ModuleType | None:
        """Return the module that replaces *name*, or None."""
        return self.loader.replacements.get(name)

    def places(self, top: str, folder: Path) -> list[Path]:
        """Return the folders that a file in *folder* imports the top-level module *top* from, in order."""
        return [folder]

    def module(self, full_name: str, path: Path, library: Library = "") -> ModuleType:
        """Return a new, empty module for the file *path*, whose messages are those of a client library."""
        module = ModuleType(full_name)
        module.__file__ = str(path)
        module.__dict__[COMPONENT_MARK] = True
        names = vars(self.replaced("builtins") or builtins)
        module.__dict__["__builtins__"] = {
            **names,
            "__import__": _Import(self, path, library or self.library),
        }
        sys.modules[full_name] = module  # dataclasses and typing look a class's module up there
        return module

    def imported(self, name: str, folder: Path, bare: bool = False) -> ModuleType | None:
        """Return the module *name* (dotted) as a file in *folder* imports it; None for one of Python's.

        The client libraries are replaced as a whole. An interface package may have Python code, too.
        """
        found = self.replaced(name)
        if found is not None and ("." in name or _is_closed(found)):
            return found
        if _is_closed(self.replaced(name.partition(".")[0])):
            return None
        own = self.find(name, folder, bare)
        if own is not None and found is not None:
            for kind in KINDS:
                if hasattr(found, kind):
                    setattr(own, kind, getattr(found, kind))
        return own or found

    def find(self, name: str, folder: Path, bare: bool = False) -> ModuleType | None:
        """Return the component's module *name* (dotted) for a file in *folder*, or None.

        Packages above it are executed first, as Python does. With *bare*, a folder without ``__init__.py`` is
        a package, too.
        """
        parent, _, last = name.rpartition(".")
        if parent:
            above = self.imported(parent, folder, bare=True)
            places = [Path(one) for one in vars(above).get("__path__", ())] if above is not None else []
        else:
            places = self.places(last, folder)
        for place in places:
            file = module_file(place, last) or _extension_file(place, last)
            if file is not None:
                return self._load(file, name)
        if bare:
            for place in places:
                if (place / last).is_dir():
                    found = ModuleType(name)
                    found.__path__ = [str(place / last)]
                    return found
        return None

    def beside(self, name: str, folder: Path) -> ModuleType | None:
        """Return the module *name* (dotted, or empty for the package itself) in *folder*, or None."""
        found = None
        parts = name.split(".") if name else ["__init__"]
        for length in range(1, len(parts) + 1):
            *above, last = parts[:length]
            file = module_file(folder.joinpath(*above), last) or _extension_file(
                folder.joinpath(*above), last
            )
            found = self._load(file, _dotted_name(file)) if file is not None else None
        return found

    def _load(self, path: Path, name: str) -> ModuleType:
        key = path.resolve()
        known = self._modules.get(key)
        if known is not None:
            return known
        if path.suffix != ".py":
            return self._load_extension(path, name)
        source = parse(path)
        module = self.module(f"{self._prefix}{name}", path)
        if path.name == "__init__.py":
            module.__path__ = [str(path.parent)]
        self._modules[key] = module  # before it runs, as Python does: modules may import each other
        try:
            self.loader.execute(source, module)
        except BaseException:
            del self._modules[key]
            raise
        is_package = path.name == "__init__.py"
        package = self._modules.get((path.parents[1 if is_package else 0] / "__init__.py").resolve())
        if package is not None:
            setattr(package, path.parent.name if is_package else path.stem, module)
        return module

    def _load_extension(self, path: Path, name: str) -> ModuleType:
        spec = spec_from_file_location(name.rpartition(".")[2], path)
        assert spec is not None, "it has a suffix of Python's extension modules"
        assert spec.loader is not None, "it is a file"
        module = self._modules[path.resolve()] = module_from_spec(spec)
        spec.loader.exec_module(module)
        return module


def _is_closed(module: ModuleType | None) -> bool:
    """Return whether a module answers for all names below it, as a replaced library does."""
    return module is not None and "__getattr__" in vars(module)


def _extension_file(folder: Path, name: str) -> Path | None:
    return next((path for end in EXTENSION_SUFFIXES if (path := folder / f"{name}{end}").is_file()), None)


def _dotted_name(path: Path) -> str:
    """Return the name of a module by the packages that its file is in."""
    parts = [] if path.name == "__init__.py" else [path.name.partition(".")[0]]
    folder = path.parent
    while (folder / "__init__.py").is_file():
        parts.insert(0, folder.name)
        folder = folder.parent
    return ".".join(parts) or "__init__"


class ScriptSpace(Space):
    """The modules of one script, which is a process of its own.

    Args:
        loader: The run's loader.
        instance: The component.
        source: Its file.
        arguments: Its arguments.
        library: Client library that it is written for.
    """

    def __init__(
        self,
        loader: Loader,
        instance: RunningInstance,
        source: SourceFile,
        arguments: Sequence[str] = (),
        library: Library = "",
    ) -> None:
        super().__init__(loader, f"{USER_MODULE_PREFIX}{instance.name}.", library)
        self._instance = instance
        self._source = source
        self._script = source.path
        self._path = [str(source.path.parent), *sys.path]
        self._process = ProcessModules(
            instance.kernel,
            instance.name,
            arguments=[str(source.path), *arguments],
            path=self._path,
            at_end=partial(loader.host.at_end, instance.context),
            leave=self._exit_at_once,
            import_module=self._import_module,
        )
        self._uses_ros: dict[str, bool] = {}

    def run(self, function: str = "", as_main: bool = True) -> None:
        """Execute the script, as ``__main__`` or as a module, then call *function* of it, if one is named.

        At the end its threads are awaited, but for daemons, and its final functions are called, as by Python.

        Raises:
            SystemExit: The script has ended with a status; also that which *function* returns.
        """
        module = self.module(f"{self._prefix}__main__", self._script)
        module.__name__ = "__main__" if as_main else self._script.stem
        self._process.sys.modules["__main__"] = module
        try:
            exec(self.loader.compile(self._source, module), module.__dict__)
            if function:
                raise SystemExit(getattr(module, function)())
        except SystemExit:
            self._finish()
            raise
        except Exception as error:
            waits = any(thread.is_alive() for thread in self._instance.threads)
            if waits:  # Python, too, shows what was raised before it waits for threads
                self._instance.report_thread(error, "run")
            self._finish()
            if waits:
                raise SystemExit(1) from error
            raise
        self._finish()

    def _finish(self) -> None:
        for thread in self._instance.threads:
            thread.join()
        self._process.over = True
        self.loader.host.leave(self._instance.name)
        self._process.finish()

    def _exit_at_once(self, status: int) -> None:
        self._process.finish()
        if status:
            self._instance.report_exit(status)
        self.loader.host.kill(self._instance.name)

    def _import_module(self, name: str, package: str | None = None) -> ModuleType:
        level = len(name) - len(name.lstrip("."))
        folder = Path(self._script.parent)
        if level:
            above = self.imported(package or "", folder)
            if above is None:
                raise TypeError(f"the 'package' argument is required to import {name!r}")
            folder = Path(vars(above)["__file__"]).parent
        import_ = _Import(self, folder / "__init__.py", self.library)
        return import_(name.lstrip("."), fromlist=("__name__",), level=level)

    def replaced(self, name: str) -> ModuleType | None:
        """See ``Space``. Modules that are the process's own come first."""
        return self._process.get(name) or super().replaced(name)

    def module(self, full_name: str, path: Path, library: Library = "") -> ModuleType:
        """See ``Space``."""
        made = super().module(full_name, path, library)
        self._process.sys.modules[full_name] = made
        return made

    def places(self, top: str, folder: Path) -> list[Path]:
        """See ``Space``."""
        if top == FRAMEWORK_PACKAGE:
            return []
        before = set(sys.path)
        found = [Path(one or ".") for one in self._path if one not in before]  # the script's folder
        if top in sys.stdlib_module_names:
            return found
        package = self.loader.workspace.python_folder(top, self._script)
        if package is not None:
            found.append(package)
        return found + [one for one in _python_path() if self._is_ros_code(one, top)]

    def _is_ros_code(self, folder: Path, top: str) -> bool:
        """Return whether a module on ``PYTHONPATH`` imports ROS, itself or by others."""
        file = module_file(folder, top)
        if file is None:
            return False
        if top not in self._uses_ros:
            self._uses_ros[top] = False  # while its own imports are followed
            files = file.parent.rglob("*.py") if file.name == "__init__.py" else (file,)
            names = {name for file in files for name in _IMPORTED.findall(_text_of(file))}
            self._uses_ros[top] = any(self._is_ros(name) for name in names)
        return self._uses_ros[top] and _RELAY not in _text_of(file)

    def _is_ros(self, name: str) -> bool:
        top = name.partition(".")[0]
        if top in sys.stdlib_module_names or top == FRAMEWORK_PACKAGE:
            return False
        if top in self.loader.replacements or _interface_kind(name):
            return True
        return any(self._is_ros_code(one, top) for one in _python_path())


_IMPORTED = re.compile(r"^\s*(?:import|from)\s+(\w[\w.]*)", re.MULTILINE)
_RELAY = "__extended_path"
"""In the ``__init__.py`` that catkin generates to lead to the sources, which are found without it."""


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _python_path() -> list[Path]:
    return [Path(word) for word in os.environ.get("PYTHONPATH", "").split(os.pathsep) if word]


def _is_library(name: str, module: ModuleType | None) -> bool:
    """Return whether a package has more than interfaces, as ``actionlib``, a client library with messages."""
    names = () if module is None or _interface_kind(name) else vars(module)
    return any(not name.startswith("_") and name not in KINDS for name in names)


def _interface_kind(name: str) -> bool:
    """Return whether a dotted name is that of interfaces, such as ``std_msgs.msg``."""
    return name.partition(".")[2].partition(".")[0] in KINDS


class _Import:
    """``__import__`` for one file."""

    def __init__(self, space: Space, file: Path, library: Library) -> None:
        self._space, self._library = space, library
        self._loader = space.loader
        self._file = file
        self._folder = file.parent

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
        if _interface_kind(name):
            self._define(name.partition(".")[0])
        found = self._find(name)
        if found is None:
            real = self._python_module(name, globals_, fromlist)
            if real is not None:
                return real
            found = self._last_found(name)
        if fromlist:
            self._submodules(found, name, fromlist, required=globals_ is not None)
            return found
        return self._top_of(name, found)

    def _find(self, name: str) -> ModuleType | None:
        found = self._space.imported(name, self._folder)
        ours = self._loader.interfaces(self._library).get(name)
        if ours is None or found is None:
            return found
        if found is self._space.replaced(name) and not _is_library(name, found):
            return ours
        vars(found).update({kind: one for kind, one in vars(ours).items() if kind in KINDS})
        return found

    def _define(self, package: str) -> bool:
        """Define the interfaces of a package if they are not known and are found; return whether they are."""
        searched = self._loader.searched
        if (package, self._folder) in searched or package in sys.stdlib_module_names:
            return False
        searched.add((package, self._folder))
        if not define_packages(self._file, [package], self._loader.workspace):
            return False
        self._loader.add_interfaces(package)
        return True

    def _python_module(
        self, name: str, globals_: Mapping[str, Any] | None, fromlist: tuple[str, ...] | None
    ) -> ModuleType | None:
        """Import one of Python's own modules or a library; None if there is none."""
        top = name.partition(".")[0]
        if top not in sys.stdlib_module_names:
            if _is_closed(self._space.replaced(top)):
                raise ModuleNotFoundError(self._missing_below(top, name), name=name)
            if top in self._loader.replacements or _interface_kind(name):
                return None
        try:
            module = builtins.__import__(name, globals_, None, fromlist or ())
        except ModuleNotFoundError as error:
            if error.name is None or error.name.partition(".")[0] != top:
                raise
            return None
        if top in COMPUTING_MODULES or (top not in sys.stdlib_module_names and top != FRAMEWORK_PACKAGE):
            self._loader.libraries.add(top)
        return module

    def _last_found(self, name: str) -> ModuleType:
        """Return an interface package that is imported by its bare name, or a folder; else raise."""
        top = name.partition(".")[0]
        found = self._find(name) if name == top and self._define(top) else None
        found = found or self._space.find(name, self._folder, bare=True)
        if found is not None:
            return found
        if _interface_kind(name):
            why = (
                "no package of that name defines interfaces beside the file or in ROS_PACKAGE_PATH or "
                "AMENT_PREFIX_PATH; source its workspace"
            )
        elif name != top and self._find(top) is not None:
            why = f"{top} has no such module; one in C or C++ must be built first"
            raise ModuleNotFoundError(f"No module named {name!r}: {why}", name=name)
        else:
            why = (
                "it is not beside the file, in a package of the workspace (ROS_PACKAGE_PATH, "
                "AMENT_PREFIX_PATH, PYTHONPATH), or installed"
            )
        missing = name if top in self._loader.replacements else top
        raise ModuleNotFoundError(f"No module named {missing!r}: {why}", name=missing)

    def _missing_below(self, top: str, name: str) -> str:
        below = [
            replacement for replacement in self._loader.replacements if replacement.startswith(f"{top}.")
        ]
        hint, instead = did_you_mean(name, below), ""
        try:
            getattr(self._loader.replacements[top], name.partition(".")[2])
        except (AttributeError, ImportError) as error:
            instead = str(error).partition(";")[2]
        return f"{name} is not there on the embedded graph{hint};{instead or ' see docs/ros.md'}"

    def _submodules(self, package: ModuleType, name: str, wanted: tuple[str, ...], *, required: bool) -> None:
        """Load the modules of ``from package import module`` before the names are looked up.

        A missing name is an error of the statement only: ``__import__(name, fromlist=…)`` looks up none.
        """
        for attribute in wanted:
            if attribute == "*" or attribute in vars(package):
                continue
            module = self._find(f"{name}.{attribute}")
            if module is not None:
                setattr(package, attribute, module)
                continue
            if not required:
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
            above = ".".join(parts[:length])
            parent = self._space.imported(above, self._folder, bare=True) or ModuleType(above)
            parent = self._loader.interfaces(self._library).get(above, parent)
            setattr(parent, parts[length], module)
            module = parent
        return module

    def _relative(self, name: str, fromlist: tuple[str, ...], level: int) -> ModuleType:
        """Import ``from .name import a`` and ``from . import a``, ``level - 1`` folders above the file."""
        folder = self._folder
        for _ in range(level - 1):
            folder = folder.parent
        package = self._space.beside(name, folder)
        inside = folder.joinpath(*name.split(".")) if name else folder
        if package is None and name and not inside.is_dir():
            raise ImportError(f"no module {'.' * level}{name} in {folder}")
        found = package or ModuleType(inside.name)
        for attribute in fromlist:
            if attribute == "*" or attribute in vars(found):
                continue
            module = self._space.beside(attribute, inside)
            if module is not None:
                setattr(found, attribute, module)
        return found
