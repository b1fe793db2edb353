"""The data as files, for owners who see the arms; who came from where, apart from them; the recruiter's list."""

import tempfile
from collections.abc import Callable
from contextlib import closing
from typing import IO, Literal, cast

from flask import Response, abort, render_template, request, send_file
from flask.typing import ResponseReturnValue

from webapp.storage.consort import read_flows
from webapp.storage.consort_figure import draw_flows
from webapp.storage.dataset import write_archive
from webapp.storage.exports import FILE_NAMES, RECRUITS, write_csv
from webapp.storage.reconciliation import Reconciliation, decoded, reconcile
from webapp.storage.researchers import log_download
from webapp.storage.snapshot import snapshot
from webapp.storage.wanted import Wanted, bundles_in
from webapp.study.reconciliation import ReconciliationError
from webapp.views.researcher.door import bp, requires, researcher
from webapp.views.researcher.frame import look
from webapp.views.researcher.sentences import RECONCILIATION
from webapp.views.researcher.words import FILES
from webapp.views.services import services

MAX_LIST_BYTES = 5 * 1024 * 1024
"""The longest list of a recruiter that can be sent."""

MAX_LISTED = 200
"""How many people of one finding the page lists; `xar reconcile` lists all."""


@bp.get("/data")
def data() -> ResponseReturnValue:
    """Offer the files."""
    return _page()


@bp.get("/<name>.csv")
@requires("owner")
def download(name: str) -> ResponseReturnValue:
    """Send a file of the data, exactly as stored or made safe for spreadsheets."""
    file = next((known for known in FILE_NAMES if known == f"{name}.csv"), None)
    if file is None:
        abort(404)
    if not look().mask.is_open:
        return _still_blind()
    is_copy = request.args.get("for") == "spreadsheet"

    def write(target: IO[bytes]) -> None:
        here = services()
        with snapshot(here.database) as connection:
            write_csv(connection, file, target, _wanted(), for_spreadsheet=is_copy)

    return _send(write, file, "text/csv", logged=_as_logged(f"{file} for spreadsheets" if is_copy else file))


@bp.get("/dataset.zip")
@requires("owner")
def dataset() -> ResponseReturnValue:
    """Send the whole data set with what describes it."""
    if not look().mask.is_open:
        return _still_blind()
    here = services()
    name = f"{look().scope.study}-{look().scope.mode}-{here.clock():%Y-%m-%d}.zip"
    return _send(
        lambda target: write_archive(here.database, target, _wanted(), here.clock()),
        name,
        "application/zip",
        logged=_as_logged("the whole data set"),
    )


@bp.get("/consort.svg")
@requires("owner")
def consort() -> ResponseReturnValue:
    """Draw the flow of participants."""
    if not look().mask.is_open:
        return _still_blind()
    with snapshot(services().database) as connection:
        flows = read_flows(connection, _wanted())
    return Response(draw_flows(flows), mimetype="image/svg+xml")


@bp.post("/recruits.csv")
@requires("owner")
def download_recruits() -> ResponseReturnValue:
    """Send who came from where, if the study has participants sent by a recruiter and it was confirmed that it must."""
    if look().study.recruitment is None:
        abort(404)
    if request.form.get("confirm") != "yes":
        return _page(problem=("recruits", "confirm that you need the ids and will keep them apart")), 422

    def write(target: IO[bytes]) -> None:
        with snapshot(services().database) as connection:
            write_csv(connection, RECRUITS, target, _wanted())

    return _send(write, RECRUITS, "text/csv", logged=RECRUITS)


@bp.post("/reconcile")
@requires("owner")
def reconcile_list() -> ResponseReturnValue:
    """Compare the recruiter's list with ours; it is not kept. That somebody saw ids beside codes is recorded."""
    # The parser holds more than a piece of the body at a time, which the limit for the forms of pages does not allow.
    request.max_content_length = request.max_form_memory_size = MAX_LIST_BYTES
    here, found = services(), look().scope
    try:
        told = reconcile(
            here.database,
            found.study,
            found.mode,
            _sent_list(),
            find_bundle=bundles_in(here.config.instance),
        )
    except ReconciliationError as error:
        return _page(problem=("reconcile", str(error))), 422
    log_download(here.database, researcher(), RECONCILIATION, here.clock())
    return _page(reconciliation=told)


def _sent_list() -> str:
    sent = request.files.get("list")
    if sent is None or not sent.filename:
        raise ReconciliationError("choose the recruiter's list, a CSV file")
    with closing(sent):
        return decoded(sent.read())


def _page(problem: tuple[str, str] | None = None, reconciliation: Reconciliation | None = None) -> str:
    return render_template(
        "researcher/data.html",
        files=[(name, FILES[name]) for name in FILE_NAMES],
        own_words=_with_own_words(),
        problem=problem,
        reconciliation=reconciliation,
        max_listed=MAX_LISTED,
    )


def _wanted() -> Wanted:
    """Return which rows are meant: those of the scope, so that nothing of masked arms comes along with others."""
    scope, instance = look().scope, services().config.instance
    return Wanted(
        scope.study,
        scope.study_version,
        scope.mode,
        with_free_text=_with_own_words() == "yes",
        find_bundle=bundles_in(instance),
    )


def _with_own_words() -> Literal["yes", "no"]:
    return "yes" if request.args.get("own_words") == "yes" else "no"


def _as_logged(what: str) -> str:
    """Return how a download stands in the log: somebody's own words may name them, so it says who has them."""
    return f"{what}, with answers in participants' own words" if _with_own_words() == "yes" else what


def _still_blind() -> ResponseReturnValue:
    return render_template("researcher/still_blind.html"), 403


def _send(write: Callable[[IO[bytes]], None], name: str, mimetype: str, logged: str) -> Response:
    """Send a file and record it.

    It is written to a nameless file first and sent from there: a slow connection must not keep the database open,
    which would keep participants' answers waiting.
    """
    here = services()
    file = cast("IO[bytes]", tempfile.TemporaryFile(dir=here.config.instance))  # noqa: SIM115 - closed with the response
    try:
        write(file)
        file.seek(0)
        log_download(here.database, researcher(), logged, here.clock())
    except BaseException:
        file.close()
        raise
    return send_file(file, mimetype=mimetype, as_attachment=True, download_name=name)
