"""How a study's own code is found: a module in the study's folder, an installed one, or an entry point.

Only the build imports it. What a web worker shows of it stands in the bundle.
"""

import hashlib
import importlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, packages_distributions, version
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any

KINDS_GROUP = "xar.kinds"
WORLDS_GROUP = "xar.worlds"
"""The groups of entry points in which installed packages offer kinds and worlds."""


PLUG_INS = "plug_ins.json"
"""The file among a bundle's sources that says where the study's own kinds and worlds came from."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a plug-in came from, for the manifest of the bundle.

    Attributes:
        use: How the study file names it.
        distribution: The installed package that it belongs to, with its version; None beside a study file.
        digest: SHA-256 of its source file in hexadecimal; None where it has none.
    """

    use: str
    distribution: str | None
    digest: str | None

    def to_json(self) -> dict[str, str | None]:
        """Return plain JSON values."""
        return asdict(self)


@contextmanager
def study_modules(folder: Path) -> Iterator[None]:
    """Let the Python files beside a study file be imported, and forget them afterwards.

    Their folder is searched first, and nothing is written into it. Within the context of the same folder this does
    nothing.

    Args:
        folder: The study's folder.
    """
    folder = folder.resolve()
    if str(folder) in sys.path[:1]:
        yield
        return
    path, known, writes = list(sys.path), set(sys.modules), sys.dont_write_bytecode
    sys.path.insert(0, str(folder))
    # Compiled code is known by its source's size and second: after a quick change it would stand for the old one.
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()
    try:
        yield
    finally:
        # A folder of modules says where it lies only while the path leads there and what it belongs to is known.
        own = [name for name in sys.modules.keys() - known if _lies_in(sys.modules[name], folder)]
        for name in own:
            del sys.modules[name]
        sys.path[:] = path
        sys.dont_write_bytecode = writes


def find(use: str, group: str, folder: Path) -> Any:  # noqa: ANN401 - whatever the researcher wrote.
    """Import what a study file names.

    Args:
        use: `module:name`, or the name of an entry point.
        group: The entry points to look among.
        folder: The study's folder; call this within `study_modules`.

    Raises:
        ValueError: There is no such module, name or entry point, or importing it failed.
    """
    if ":" not in use:
        return _load(_entry_point(use, group))
    module_name, _, attribute = use.partition(":")
    module = _import(module_name, folder)
    try:
        return attrgetter(attribute)(module)
    except AttributeError:
        raise ValueError(f"the module {module_name!r} has no {attribute!r}") from None


def origin_of(use: str, found: Any, folder: Path) -> Origin:  # noqa: ANN401 - as `find` returns it.
    """Tell where a plug-in came from.

    Args:
        use: How the study file names it.
        found: It.
        folder: The study's folder.
    """
    code = inspect.unwrap(found) if inspect.isroutine(found) or inspect.isclass(found) else type(found)
    try:
        file = inspect.getsourcefile(code)
    except TypeError:
        file = None  # It is not written in Python.
    digest = None if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()
    is_beside = file is not None and Path(file).resolve().is_relative_to(folder.resolve())
    return Origin(use, None if is_beside else _distribution(code.__module__), digest)


def _entry_point(name: str, group: str) -> EntryPoint:
    offered = {(point.name, point.value): point for point in entry_points(group=group)}
    matching = [point for (known, _), point in sorted(offered.items()) if known == name]
    if not matching:
        names = ", ".join(sorted({known for known, _ in offered})) or "none"
        raise ValueError(f"there is no entry point {name!r} of the group {group!r}; there are: {names}")
    if len(matching) > 1:
        raise ValueError(f"several installed packages offer the entry point {name!r} of {group!r}; use module:name")
    return matching[0]


def _load(point: EntryPoint) -> Any:  # noqa: ANN401 - as for `find`.
    try:
        return point.load()
    except Exception as problem:
        raise ValueError(
            f"the entry point {point.name!r} ({point.value}) cannot be loaded: {type(problem).__name__}: {problem}"
        ) from problem


def _import(name: str, folder: Path) -> ModuleType:
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as problem:
        if problem.name is not None and (name == problem.name or name.startswith(f"{problem.name}.")):
            raise ValueError(f"there is no module {name!r} beside the study file or among what is installed") from None
        raise ValueError(f"the module {name!r} cannot be imported: {problem}") from problem
    except (Exception, SystemExit) as problem:
        raise ValueError(f"the module {name!r} cannot be imported: {type(problem).__name__}: {problem}") from problem
    top = name.partition(".")[0]
    for beside in (f"{top}.py", f"{top}/__init__.py"):
        if (folder / beside).exists() and not _lies_in(module, folder.resolve()):
            raise ValueError(f"the module {name!r} is another than {beside} beside the study file; rename the file")
    return module


def _lies_in(module: ModuleType, folder: Path) -> bool:
    """Tell whether a module was imported from a folder; one without a file is a folder of modules."""
    file = getattr(module, "__file__", None)
    places = getattr(module, "__path__", ()) if file is None else (file,)
    return any(Path(place).resolve().is_relative_to(folder) for place in places)


def _distribution(module: str) -> str | None:
    for name in packages_distributions().get(module.partition(".")[0], ()):
        try:
            return f"{name} {version(name)}"
        except PackageNotFoundError:
            continue
    return None
