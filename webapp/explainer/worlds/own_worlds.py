"""A researcher's own environment, named as `module:callable`."""

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from webapp.explainer.worlds.finite import GUIDE, FiniteWorld


def load(name: str, options: Mapping[str, Any]) -> Any:  # noqa: ANN401 - an environment or a world, as it comes.
    """Import a callable and call it.

    The current folder is searched for the module too, after everything that is installed.

    Args:
        name: Such as `mypackage.machine:Machine`.
        options: The arguments of the call, by name.

    Returns:
        A `FiniteWorld`, or whatever has Gymnasium's `reset` and `step`.

    Raises:
        ValueError: There is no such module or name in it, it cannot be called with these options, or it returns
            something else.
    """
    module_name, _, attribute = name.partition(":")
    if not attribute or not all(part.isidentifier() for part in f"{module_name}.{attribute}".split(".")):
        raise ValueError(
            f"an environment of your own is named module:callable, such as mypackage.machine:Machine, not {name!r}"
        )
    module = _import(module_name)
    if not hasattr(module, attribute):
        raise ValueError(f"the module {module_name!r} has no {attribute!r}")
    return make(getattr(module, attribute), name, options)


def make(found: Any, name: str, options: Mapping[str, Any]) -> Any:  # noqa: ANN401 - as for `load`.
    """Call what was imported, or take it as it is.

    Args:
        found: A callable that returns a world or an environment, or one of these itself.
        name: What to call it in messages.
        options: The arguments of the call, by name.

    Returns:
        A `FiniteWorld`, or whatever has Gymnasium's `reset` and `step`.

    Raises:
        ValueError: It cannot be called with these options, or it returns something else.
    """
    made = found
    if callable(made):
        try:
            made = made(**options)
        except Exception as problem:
            raise ValueError(f"{name} cannot be made: {type(problem).__name__}: {problem}") from problem
    elif options:
        raise ValueError(f"{name} is not called, so it takes no options, and got {', '.join(options)}")
    if isinstance(made, FiniteWorld) or (hasattr(made, "reset") and hasattr(made, "step")):
        return made
    missing = [member for member in ("actions", "start", "outcomes") if not hasattr(made, member)]
    raise ValueError(
        f"{name} gave a {type(made).__name__}, which is neither a Gymnasium environment nor a finite world: "
        f"it has no {', '.join(missing)} ({GUIDE} says what a world needs)"
    )


def _import(name: str) -> Any:  # noqa: ANN401 - a module, whose names nobody knows.
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as problem:
        if problem.name is not None and (name == problem.name or name.startswith(f"{problem.name}.")):
            raise ValueError(f"there is no module {name!r} in {here} or among what is installed") from None
        raise ValueError(f"the module {name!r} cannot be imported: {problem}") from problem
    except Exception as problem:
        raise ValueError(f"the module {name!r} cannot be imported: {type(problem).__name__}: {problem}") from problem
