"""The names that researchers import: documented, with examples that run, typed, and free until they are used."""

import ast
import doctest
import inspect
import pkgutil
import subprocess
import sys
import typing
from collections.abc import Callable
from pathlib import Path

import pytest

import webapp.explainer as api

HEAVY = ("gymnasium", "matplotlib", "minigrid", "numpy", "PIL", "scipy", "torch")

Documented = type | Callable[..., object]


def public(name: str) -> Documented:
    found: Documented = getattr(api, name)
    return found


def examples_of(name: str) -> doctest.DocTest:
    (found,) = doctest.DocTestFinder(recurse=False).find(public(name), name, module=False, globs={})
    return found


@pytest.mark.parametrize("name", api.__all__)
def test_every_public_name_has_an_example_that_uses_it_or_what_makes_it(name: str) -> None:
    text = inspect.getdoc(public(name)) or ""
    assert text.count("Example:") == 1
    shown = text.split("Example:")[1]
    assert len(examples_of(name).examples) > 1
    assert "from webapp.explainer import " in shown
    made_by = {"Explanation": "explain", "Layout": "parse_layout", "Sampled": "sample_importance"}
    assert name in shown or made_by.get(name, "from_outcomes") in shown


@pytest.mark.parametrize("name", api.__all__)
def test_every_example_runs_as_it_is_shown(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    results = doctest.DocTestRunner(optionflags=doctest.REPORT_NDIFF).run(examples_of(name))
    assert results.failed == 0, capsys.readouterr().out
    assert results.attempted > 1


@pytest.mark.parametrize("name", api.__all__)
def test_every_example_imports_from_the_surface_alone(name: str) -> None:
    code = "".join(example.source for example in examples_of(name).examples)
    homes = {node.module for node in ast.walk(ast.parse(code)) if isinstance(node, ast.ImportFrom)}
    assert {home for home in homes if (home or "").startswith("webapp")} == {"webapp.explainer"}


@pytest.mark.parametrize("name", api.__all__)
def test_every_type_hint_of_a_public_name_can_be_looked_up(name: str) -> None:
    found = public(name)
    if found is api.FiniteWorld:
        found = api.FiniteWorld.outcomes
    hints = typing.get_type_hints(found)
    if inspect.isfunction(found):
        assert set(hints) == {*inspect.signature(found).parameters, "return"} - {"self"}
    else:
        assert hints


def test_the_surface_is_what_the_imports_for_type_checkers_say() -> None:
    tree = ast.parse(Path(api.__file__).read_text(encoding="utf-8"))
    typed = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("webapp.")
        for alias in node.names
    }
    assert sorted(typed) == sorted(api.__all__)
    for name, (module, original) in typed.items():
        assert module is not None
        assert getattr(api, name) is getattr(sys.modules[module], original)


def test_no_public_name_hides_behind_a_module_of_the_same_name() -> None:
    # Importing a module sets it as an attribute of its package, in the place of whatever the package calls so.
    assert {module.name for module in pkgutil.iter_modules(api.__path__)} & set(api.__all__) == set()


def test_everything_can_be_had_at_once_and_is_listed() -> None:
    names: dict[str, object] = {}
    exec("from webapp.explainer import *", names)  # noqa: S102 - an import by star cannot stand in a function.
    assert set(api.__all__) <= set(names)
    assert set(api.__all__) <= set(dir(api))


def test_a_misspelt_name_is_refused_as_of_any_module() -> None:
    with pytest.raises(AttributeError, match=r"^module 'webapp.explainer' has no attribute 'exact_importanse'$"):
        getattr(api, "exact_importanse")  # noqa: B009 - a type checker refuses the plain spelling, as it should.
    with pytest.raises(ImportError, match=r"cannot import name 'exact_importanse' from 'webapp.explainer'"):
        exec("from webapp.explainer import exact_importanse")  # noqa: S102 - as above.


def loaded_by(statement: str) -> set[str]:
    """Return which of the heavy packages a fresh process holds after a statement."""
    program = f"import sys\n{statement}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(run.stdout.split()) & set(HEAVY)


def test_the_package_itself_loads_nothing_heavy() -> None:
    assert loaded_by("import webapp.explainer; dir(webapp.explainer)") == set()


def test_a_name_loads_what_it_needs_and_no_more() -> None:
    assert loaded_by("from webapp.explainer import parse_layout") == set()
    assert loaded_by("from webapp.explainer import exact_importance, explain, plan_world, tabulate") == {"numpy"}
    assert loaded_by("from webapp.explainer import reach_probability") == {"numpy", "scipy"}
    assert "torch" in loaded_by("from webapp.explainer import train")
