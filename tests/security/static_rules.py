"""What no code of ours may do, found by reading it: each rule goes from a syntax tree to the lines at fault."""

import ast
from collections.abc import Callable, Iterator, Mapping

_SERIALISERS = {"pickle", "cPickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle", "jsonpickle", "telnetlib"}
_SECRET = {"token", "password", "secret", "nonce", "mark", "signature", "mac", "token_hash", "password_hash"}

_CLIENTS = {"urllib3", "requests", "httpx", "ftplib", "smtplib", "socket"}


def _imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every module that is imported, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, name.name) for name in node.names)
        if isinstance(node, ast.ImportFrom):
            yield node.lineno, node.module or ""


def _called(node: ast.AST) -> str:
    """The dotted name of what is called, or nothing."""
    return ast.unparse(node.func) if isinstance(node, ast.Call) else ""


def _keyword(node: ast.Call, name: str) -> object:
    return next((getattr(word.value, "value", "?") for word in node.keywords if word.arg == name), None)


def _calls(tree: ast.AST) -> Iterator[tuple[ast.Call, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield node, _called(node)


def serialisers(tree: ast.AST) -> Iterator[int]:
    """Loading these runs what somebody else wrote."""
    yield from (line for line, name in _imports(tree) if name.partition(".")[0] in _SERIALISERS)
    yield from (call.lineno for call, name in _calls(tree) if name.endswith(("read_pickle", "joblib.load")))


def unsafe_loaders(tree: ast.AST) -> Iterator[int]:
    """Weights and arrays are data alone; YAML is not read at all."""
    for call, name in _calls(tree):
        is_torch = name == "torch.load" and _keyword(call, "weights_only") is not True
        is_numpy = name.endswith(("np.load", "numpy.load")) and _keyword(call, "allow_pickle") not in {None, False}
        is_yaml = name in {"yaml.load", "yaml.unsafe_load", "yaml.full_load", "yaml.load_all"}
        is_xml = name.startswith(("xml.", "ElementTree.", "etree.", "minidom.")) and "parse" in name.lower()
        if is_torch or is_numpy or is_yaml or is_xml:
            yield call.lineno


def run_strings(tree: ast.AST) -> Iterator[int]:
    """No text becomes code."""
    for call, name in _calls(tree):
        if name in {"eval", "exec", "compile", "__import__", "builtins.eval", "builtins.exec"}:
            yield call.lineno


def templates_from_texts(tree: ast.AST) -> Iterator[int]:
    """No text becomes a template, and none is called safe that is put together from others."""
    for call, name in _calls(tree):
        if name.endswith(("render_template_string", "from_string", "jinja2.Template")):
            yield call.lineno
        is_markup = name in {"Markup", "markupsafe.Markup"}
        if is_markup and not (len(call.args) == 1 and isinstance(call.args[0], ast.Constant)):
            yield call.lineno


def shells(tree: ast.AST) -> Iterator[int]:
    """No command goes through a shell."""
    for call, name in _calls(tree):
        is_shell = name in {"os.system", "os.popen", "subprocess.getoutput", "subprocess.getstatusoutput"}
        if is_shell or (name.startswith("subprocess.") and _keyword(call, "shell") not in {None, False}):
            yield call.lineno


def named_temporary_files(tree: ast.AST) -> Iterator[int]:
    """A name that is made before its file can be taken by somebody else."""
    yield from (call.lineno for call, name in _calls(tree) if name in {"tempfile.mktemp", "mktemp", "os.tempnam"})


def weak_digests(tree: ast.AST) -> Iterator[int]:
    """SHA-256 and what is stronger."""
    for call, name in _calls(tree):
        is_named = name == "hashlib.new" and ast.unparse(call.args[0]) in {"'sha1'", "'md5'", "'md4'"}
        if name in {"hashlib.md5", "hashlib.sha1"} or is_named:
            yield call.lineno


def compared_secrets(tree: ast.AST) -> Iterator[int]:
    """Secrets are compared in a time that does not tell what they share; in a query the index is asked."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Compare) or not isinstance(node.ops[0], ast.Eq | ast.NotEq):
            continue
        sides = [node.left, *node.comparators]
        words = {ast.unparse(side).rpartition(".")[2] for side in sides}
        is_query = any(".c." in ast.unparse(side) for side in sides)
        is_constant = any(isinstance(side, ast.Constant) for side in sides)
        if words & _SECRET and not is_query and not is_constant:
            yield node.lineno


def predictable_secrets(tree: ast.AST) -> Iterator[int]:
    """Where secrets and places are drawn, the operating system draws."""
    yield from (line for line, name in _imports(tree) if name in {"random", "uuid"})


def written_sql(tree: ast.AST) -> Iterator[int]:
    """SQL that is put together from texts."""
    for call, name in _calls(tree):
        is_sql = name in {"text", "sqlalchemy.text", "exec_driver_sql"} or name.endswith(
            (".exec_driver_sql", ".execute")
        )
        if is_sql and call.args and isinstance(call.args[0], ast.JoinedStr | ast.BinOp):
            yield call.lineno


def outgoing_requests(tree: ast.AST) -> Iterator[int]:
    """A server that asks nobody anything can be made to ask nobody anything."""
    for line, name in _imports(tree):
        if name.partition(".")[0] in _CLIENTS or name in {"urllib.request", "http.client"}:
            yield line


Rule = Callable[[ast.AST], Iterator[int]]

EVERYWHERE: Mapping[str, Rule] = {
    rule.__name__: rule
    for rule in (
        serialisers,
        unsafe_loaders,
        run_strings,
        templates_from_texts,
        shells,
        named_temporary_files,
        weak_digests,
        compared_secrets,
        written_sql,
    )
}
"""Rules for every module."""

OF_THE_SERVER: Mapping[str, Rule] = {rule.__name__: rule for rule in (predictable_secrets, outgoing_requests)}
"""Rules for what runs in the server: the application, views and storage."""

BAD: Mapping[str, tuple[str, ...]] = {
    "serialisers": (
        "import pickle",
        "from marshal import loads",
        "import dill as d",
        "pandas.read_pickle(path)",
        "joblib.load(path)",
    ),
    "unsafe_loaders": (
        "torch.load(path)",
        "torch.load(path, weights_only=False)",
        "np.load(path, allow_pickle=True)",
        "yaml.load(text)",
        "ElementTree.parse(path)",
    ),
    "run_strings": ("eval(text)", "exec(text)", "compile(text, 'x', 'exec')", "__import__(name)"),
    "templates_from_texts": (
        "render_template_string(text)",
        "Environment().from_string(text)",
        "Markup(text)",
        "Markup(f'<b>{text}</b>')",
        "Markup('<b>' + text)",
    ),
    "shells": ("os.system(command)", "subprocess.run(command, shell=True)", "os.popen(command)"),
    "named_temporary_files": ("tempfile.mktemp()",),
    "weak_digests": ("hashlib.md5(content)", "hashlib.new('sha1')"),
    "compared_secrets": ("if token == other: pass", "x = form.nonce != nonce", "return_ = a.password_hash == b"),
    "written_sql": ("connection.execute(f'SELECT {x}')", "text('SELECT ' + x)"),
    "predictable_secrets": ("import random", "from uuid import uuid4"),
    "outgoing_requests": ("import urllib3", "from urllib.request import urlopen", "import socket"),
}
"""For each rule, what it has to find: the control."""
