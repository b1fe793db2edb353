"""Results and data of a study that has everything: masked arms, predictions, drives, translations, recruits."""

import csv
import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask
from sqlalchemy import Connection, Engine, event
from werkzeug.test import TestResponse

from tests.unit.storage.people import DRIVING, enrol_somebody, send, walk, walk_to
from tests.web.bundles import read_study, write_bundle
from tests.web.people import ITEMS, SAME_SITE, Visitor
from tests.web.reading import ask
from tests.web.researchers import NAME, PASSWORD, researcher_of, rows, sign_in, unblind
from webapp.config import Config
from webapp.storage.export_columns import PARTICIPANTS_COLUMNS, RATINGS, names
from webapp.storage.exports import FILE_NAMES, RECRUITS
from webapp.storage.participants import Participant
from webapp.study.answers import Answer, PageContent
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit
from webapp.study.sections import Quality, Recruitment
from webapp.views.researcher.words import PAGES
from webapp.views.services import services_of

KINDS = ("tailored_all", "placebic", "evenly_spaced")
RECRUIT = Recruit("prolific", "0123456789abcdef01234567", "fedcba987654321001234567", "session12345")
BLIND_PAGES = ("", "status.json", "people", "people.json", "allocation", "quality", "results", "data", "records")


def study_with(*kinds: str) -> Study:
    """A study with everything around the trials, and these kinds."""
    (experiment,) = DRIVING.experiments
    assert DRIVING.quiz is not None
    return DRIVING.model_copy(
        update={
            "experiments": (experiment.model_copy(update={"satisfaction": True, "kinds": kinds}),),
            "recruitment": Recruitment(service="prolific"),
            "quiz": DRIVING.quiz.model_copy(update={"on_failure": "screen_out"}),
            "quality": Quality(straight_lining=True, min_total_minutes=600),
        }
    )


@pytest.fixture
def driving(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    write_bundle(instance, study_with(*KINDS))
    return start_app(Config(instance, study=DRIVING.name))


def take_part(app: Flask, recruit: Recruit | None = None, language: str = "en", *, fails: bool = False) -> Participant:
    """Go all the way, or to the quiz and out, straight into the storage."""
    here = services_of(app)
    study, version = here.bundles.current.study, here.bundles.current.version
    participant = enrol_somebody(here.database, "test", version, study=study, language=language, recruit=recruit)
    if fails:
        page = walk_to(here.database, participant, "quiz", study)
        content = PageContent(answers=[Answer("goal", "key", is_correct=False)], failed=True, screens_out=True)
        send(here.database, participant, page.number, study=study, content=content)
    else:
        walk(here.database, participant, participant.num_pages, study=study)
    return participant


def plain(html: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", html)).strip()


def table_rows(page: str, mark: str) -> dict[str, list[str]]:
    """The cells of the rows with an attribute, by its value."""
    found = re.findall(rf'<tr data-{mark}="([^"]+)">(.*?)</tr>', page, flags=re.DOTALL)
    return {name: [plain(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL)] for name, row in found}


def kinds_told(text: str) -> set[str]:
    """The kinds that a page tells, in whatever writing."""
    told = text.lower().replace("&#34;", '"')
    return {kind for kind in KINDS for name in (kind, kind.replace("_", " "), kind.replace("_", "-")) if name in told}


@pytest.mark.parametrize("role", ["viewer", "owner", "admin"])
def test_nothing_tells_a_kind_to_whoever_is_blind(driving: Flask, role: str) -> None:
    people = [take_part(driving), take_part(driving), take_part(driving, fails=True)]
    visitor = researcher_of(driving, role)  # type: ignore[arg-type]
    for path in (*BLIND_PAGES, *(f"people/{person.code}" for person in people)):
        answer = visitor.get(f"/researcher/{path}")
        assert answer.status_code == 200
        assert kinds_told(answer.text + str(answer.headers)) == set(), path
    for path in ("/researcher/allocation/replay", "/researcher/records/verify"):
        assert kinds_told(visitor.post(path).text) == set()
    for name in (*FILE_NAMES, "dataset.zip", "consort.svg"):
        answer = visitor.get(f"/researcher/{name}")
        assert answer.status_code == 403
        assert kinds_told(answer.text) == set()


def test_what_was_drawn_for_a_person_stands_on_no_page(driving: Flask) -> None:
    person = take_part(driving)
    visitor = researcher_of(driving)
    for path in (f"people/{person.code}", "records", "records?show=allocation"):
        page = visitor.get(f"/researcher/{path}").text
        assert "a place in the study was drawn" in page
        assert "arrangement" not in page.lower()
        assert not re.search("Arm [A-C]", page.replace("Arms", ""))


def test_arms_stand_in_the_order_of_their_letters_while_masked(driving: Flask) -> None:
    take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/results").text
    assert list(table_rows(page, "predictions")) == ["Arm A", "Arm B", "Arm C"]
    assert list(table_rows(visitor.get("/researcher/").text, "arm")) == ["Arm A", "Arm B", "Arm C"]


def test_no_letter_stands_with_a_layout_while_masked(driving: Flask) -> None:
    take_part(driving)
    take_part(driving)
    visitor = researcher_of(driving)
    for path in ("", "allocation"):
        page = visitor.get(f"/researcher/{path}").text
        assert "data-cell" not in page
        assert set(table_rows(page, "layout")) == set(DRIVING.experiments[0].layouts)
    status = visitor.get("/researcher/status.json").get_json()
    assert status["cells"] == []
    assert {layout["experiment"] for layout in status["layouts"]} == {DRIVING.experiments[0].id}
    for layout in status["layouts"]:
        assert 0 <= layout["fewest_assigned"] <= layout["most_assigned"] <= 2
        assert (layout["fewest_done"], layout["most_done"]) == (layout["fewest_assigned"], layout["most_assigned"])
    assert sum(layout["most_assigned"] for layout in status["layouts"]) >= len(status["layouts"])
    unblind(visitor)
    status = visitor.get("/researcher/status.json").get_json()
    assert (status["layouts"], len(status["cells"])) == ([], len(KINDS) * len(DRIVING.experiments[0].layouts))
    assert "data-cell" in visitor.get("/researcher/").text


def test_of_masked_arrangements_is_told_how_many_are_held_how_often(driving: Flask) -> None:
    (experiment,) = DRIVING.experiments
    take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/allocation").text
    (of_nobody,), (of_one,) = (table_rows(page, "held")[times] for times in ("0", "1"))
    assert (of_one, f'id="arrangements-{experiment.id}"' in page) == ("1", False)
    unblind(visitor)
    page = visitor.get("/researcher/allocation").text
    (table,) = re.findall(rf'id="arrangements-{experiment.id}".*?</table>', page, re.DOTALL)
    assert table.count('<th scope="row">') == 1 + int(of_nobody)


def test_what_only_some_arms_have_is_left_out_while_masked(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    write_bundle(instance, study_with("tailored_all", "placebic", "none"))
    app = start_app(Config(instance, study=DRIVING.name))
    take_part(app)
    visitor = researcher_of(app)
    masked = visitor.get("/researcher/results").text
    assert "Left out while masked" in masked
    assert not table_rows(masked, "before")
    assert not table_rows(masked, "gain")
    assert "satisfaction scale" not in masked
    assert set(re.findall('data-item="([^"]+)"', masked)) == {"foresee"}
    unblind(visitor)
    shown = visitor.get("/researcher/results").text
    assert list(table_rows(shown, "before")) == ["tailored all"]
    assert "satisfaction scale" in shown
    assert {"foresee", "likeliness"} <= set(re.findall('data-item="([^"]+)"', shown))


def pages_timed(visitor: Visitor) -> set[str]:
    """The kinds of pages about whose times the overview tells."""
    (table,) = re.findall(r'id="times-caption".*?</table>', visitor.get("/researcher/").text, re.DOTALL)
    return set(re.findall(r'<th scope="row" class="words">(.*?)</th>', table))


def test_times_of_pages_that_only_some_arms_have_are_left_out_while_masked(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    write_bundle(instance, study_with("tailored_all", "placebic", "none"))
    app = start_app(Config(instance, study=DRIVING.name))
    take_part(app)
    visitor = researcher_of(app)
    masked = pages_timed(visitor)
    unblind(visitor)
    telling = {PAGES[kind] for kind in ("first_drive", "explanation", "satisfaction")}
    assert masked == pages_timed(visitor) - telling
    assert telling - {PAGES["explanation"]} <= pages_timed(visitor)


def test_unblinding_takes_password_and_reason_and_is_on_record(driving: Flask, instance: Path) -> None:
    take_part(driving)
    visitor = researcher_of(driving)
    for password, reason, words in (
        ("wrong", "because", "the password is not right"),
        (PASSWORD, " ", "the reason is"),
    ):
        answer = unblind(visitor, reason, password)
        assert answer.status_code == 422
        assert words in answer.text
    assert ask(instance, "SELECT 1 FROM records WHERE action = 'unblinded'") == []
    assert unblind(visitor, "All are paid").headers["Location"] == "/researcher/results?done=unblinded"
    logged = ask(
        instance,
        "SELECT actor, mode, content FROM records JOIN record_contents USING (number) WHERE action = 'unblinded'",
    )
    assert logged == [(NAME, "test", '{"reason":"All are paid"}')]
    page = visitor.get("/researcher/results").text
    assert "You see the arms since" in page
    assert list(table_rows(page, "predictions")) == [kind.replace("_", " ") for kind in KINDS]


def test_guessing_the_password_while_unblinding_is_slowed_down(driving: Flask) -> None:
    visitor = researcher_of(driving)
    answers = [unblind(visitor, password="wrong").text for _ in range(14)]  # noqa: S106 - it is wrong
    assert any("too many attempts" in answer for answer in answers)


def test_unblinding_is_for_one_account_and_one_scope(driving: Flask) -> None:
    take_part(driving)
    visitor, other = researcher_of(driving), researcher_of(driving, name="other")
    unblind(visitor)
    assert kinds_told(visitor.get("/researcher/allocation").text) == set(KINDS)
    assert kinds_told(other.get("/researcher/allocation").text) == set()
    assert kinds_told(visitor.get("/researcher/allocation?mode=live").text) == set()
    assert visitor.get("/researcher/ratings.csv?mode=live").status_code == 403
    sign_in(visitor)
    assert kinds_told(visitor.get("/researcher/allocation").text) == set(KINDS)


def test_every_estimate_stands_with_its_interval_and_what_it_rests_on(driving: Flask) -> None:
    take_part(driving)
    take_part(driving)
    visitor = researcher_of(driving)
    unblind(visitor)
    shown = visitor.get("/researcher/results").text
    assert table_rows(shown, "predictions")["placebic"][:4] == ["100 %", "34 to 100", "2", "4"]
    assert (
        table_rows(shown, "calibration")["placebic"]
        == ["3.00", "\N{EN DASH}", "\N{EN DASH}", "100 % n = 4"] + ["\N{EN DASH}"] * 2
    )
    assert table_rows(shown, "before")["tailored all"][0] == "0 %"
    assert "placebic" not in table_rows(shown, "before")
    assert table_rows(shown, "gain")["tailored all"][0] == "+0"


def test_the_means_stand_in_the_table_and_on_the_chart(driving: Flask) -> None:
    take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/results").text
    means = re.findall(r'data-mean="([\d.]+)"', page)
    assert set(means) == {"3.0"}
    assert page.count('cx="50.00%"') >= len(means)


def test_each_item_is_drawn_on_a_scale_of_its_own(instance: Path, start_app: Callable[[Config], Flask]) -> None:
    (experiment,) = DRIVING.experiments
    first, *others = experiment.items
    items = (first.model_copy(update={"points": 7}), *others)
    study = DRIVING.model_copy(update={"experiments": (experiment.model_copy(update={"items": items}),)})
    write_bundle(instance, study)
    app = start_app(Config(instance, study=study.name))
    take_part(app)
    visitor = researcher_of(app)
    unblind(visitor)
    tables = re.findall(r'id="ratings-\d+-(\d)".*?</table>', visitor.get("/researcher/results").text, re.DOTALL)
    assert tables == ["5", "7"]


@pytest.mark.parametrize("points", [5, 7])
def test_the_means_are_shown_on_the_scale_of_the_study_file(
    points: int, instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    experiments = tuple(
        experiment.model_copy(
            update={"items": tuple(item.model_copy(update={"points": points}) for item in experiment.items)}
        )
        for experiment in read_study().experiments
    )
    write_bundle(instance, read_study(experiments=experiments))
    app = start_app(Config(instance))
    person = Visitor(app)
    person.agree()
    person.walk()
    page = researcher_of(app).get("/researcher/results").text
    assert f"From 1 to {points}." in page
    assert page.count(f'text-anchor="end">{points}</text>') == 2


def test_whoever_was_screened_out_is_counted_where_the_quiz_can_end_the_study(driving: Flask) -> None:
    take_part(driving, fails=True)
    visitor = researcher_of(driving)
    counts = visitor.get("/researcher/status.json").get_json()["counts"]
    assert (counts["arrived"], counts["screened_out"], counts["in_progress"]) == (1, 1, 0)
    page = visitor.get("/researcher/").text
    assert 'data-count="screened_out">1<' in page
    assert '<span class="state state--screened_out" data-value="state">screened out</span>' in page


def test_declared_rules_are_told_with_whom_they_flag_and_exclude_nobody(driving: Flask) -> None:
    person = take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/quality").text
    assert table_rows(page, "rule")["straight_lining"][1:] == ["1", "1"]
    assert "finished the study in less than 600 min" in page
    assert f'href="/researcher/people/{person.code}"' in page
    assert "never a reason by itself" in page
    assert "Nobody is excluded" in page


def test_people_are_found_by_rule_and_exclusion(driving: Flask) -> None:
    people = [take_part(driving), take_part(driving), take_part(driving, fails=True)]
    visitor = researcher_of(driving)
    visitor.post(f"/researcher/people/{people[0].code}/exclude", {"reason": "A friend answered"})

    def found(query: str) -> set[str]:
        told = visitor.get(f"/researcher/people.json?{query}").get_json()
        assert told["num_found"] == len(told["participants"])
        return {line["code"] for line in told["participants"]}

    assert found("excluded=yes") == {people[0].code}
    assert found("flagged=straight_lining") == {people[0].code, people[1].code}
    assert found("flagged=failed_quiz&excluded=yes") == set()
    page = visitor.get("/researcher/people?flagged=straight_lining&page=9").text
    assert '<option value="straight_lining" selected>straight-lining</option>' in page
    assert people[1].code in page


def test_unvalidated_translations_are_noted_with_their_readers(driving: Flask) -> None:
    take_part(driving, language="ja")
    take_part(driving)
    visitor = researcher_of(driving)
    for path in ("/researcher/", "/researcher/results"):
        notes = re.findall(r'<p class="note">(The rating items.*?)</p>', visitor.get(path).text)
        assert [plain(note)[:79] for note in notes] == [
            "The rating items in ja are an unvalidated translation (participants: 1). Cite a"
        ]


def test_the_csv_holds_what_was_clicked(app: Flask) -> None:
    person = Visitor(app)
    person.agree()
    clicked: dict[int, dict[str, str]] = {}
    for number in range(1, 12):
        answers = {item: str(1 + (7 * number + place) % 5) for place, item in enumerate(ITEMS)}
        person.answer(number, **{f"rating_{item}": value for item, value in answers.items()})
        if number >= 3 and number % 2:
            clicked[number] = answers
    researcher = researcher_of(app)
    unblind(researcher)
    found = rows(researcher, "ratings.csv")
    assert tuple(found[0]) == names(RATINGS)
    places = [("1", "1"), ("1", "2"), ("1", "3"), ("2", "1"), ("2", "2")]
    for (experiment, trial), answers in zip(places, clicked.values(), strict=True):
        own = [row for row in found if (row["experiment"], row["trial"]) == (experiment, trial)]
        assert {row["item"]: row["rating"] for row in own} == answers
    assert {row["study_version"] for row in found} == {services_of(app).bundles.current.version}
    (line,) = rows(researcher, "participants.csv")
    assert tuple(line) == PARTICIPANTS_COLUMNS
    assert (line["participant"], line["num_pages_sent"]) == (found[0]["participant"], "11")


def test_downloads_are_files_and_are_on_record(driving: Flask, instance: Path) -> None:
    take_part(driving)
    visitor = researcher_of(driving)
    unblind(visitor)
    page = visitor.get("/researcher/data").text
    offered = re.findall(r'href="/researcher/(\w+\.csv)\?own_words=no" download', page)
    assert offered == list(FILE_NAMES)
    for name in FILE_NAMES:
        answer = visitor.get(f"/researcher/{name}")
        assert answer.headers["Content-Type"] == "text/csv; charset=utf-8"
        assert answer.headers["Content-Disposition"] == f"attachment; filename={name}"
        assert answer.headers["Cache-Control"] == "no-store"
        assert not answer.data.startswith(b"\xef\xbb\xbf")
    visitor.get("/researcher/answers.csv?for=spreadsheet")
    assert downloads(instance) == [*FILE_NAMES, "answers.csv for spreadsheets"]


def downloads(instance: Path) -> list[str]:
    """What the log says was downloaded."""
    query = (
        "SELECT content FROM records JOIN record_contents USING (number) WHERE action = 'downloaded' ORDER BY number"
    )
    return [json.loads(str(content))["file"] for (content,) in ask(instance, query)]


def test_the_log_tells_who_has_what_participants_said_in_their_own_words(driving: Flask, instance: Path) -> None:
    visitor = researcher_of(driving)
    unblind(visitor)
    for name in ("answers.csv", "answers.csv?own_words=yes", "dataset.zip", "dataset.zip?own_words=yes"):
        assert visitor.get(f"/researcher/{name}").status_code == 200
    words = ", with answers in participants' own words"
    whole = "the whole data set"
    assert downloads(instance) == ["answers.csv", f"answers.csv{words}", whole, f"{whole}{words}"]
    log = visitor.get("/researcher/records?show=downloaded").text.replace("&#39;", "'")
    assert f"downloaded {whole}{words}" in log


def test_flow_and_recruits_are_read_from_a_copy_of_the_database(driving: Flask, instance: Path) -> None:
    take_part(driving, RECRUIT)
    visitor = researcher_of(driving)
    unblind(visitor)
    asked: list[tuple[str, str]] = []

    def note(connection: Connection, _cursor: object, statement: str, *_: object) -> None:
        asked.append((str(connection.engine.url.database or ""), statement))

    event.listen(Engine, "before_cursor_execute", note)
    try:
        assert visitor.get("/researcher/consort.svg").status_code == 200
        visitor.post("/researcher/recruits.csv", {"confirm": "yes"}).close()
    finally:
        event.remove(Engine, "before_cursor_execute", note)
    for table in ("arrangements", "recruits"):
        whole = [path for path, statement in asked if re.search(rf"FROM .*\b{table}\b", statement, re.DOTALL)]
        assert whole
        assert not any(path.startswith(str(instance)) for path in whole)


def test_the_whole_data_set_comes_as_one_archive(app: Flask) -> None:
    person = take_part(app)
    visitor = researcher_of(app)
    unblind(visitor)
    with zipfile.ZipFile(io.BytesIO(visitor.get("/researcher/dataset.zip").data)) as archive:
        manifest = json.loads(archive.read("manifest.json"))
        table = archive.read("data/description-ratings_data.csv").decode()
    assert manifest["scope"]["mode"] == "test"
    assert {row["participant"] for row in csv.DictReader(io.StringIO(table))} == {person.code}
    flow = visitor.get("/researcher/consort.svg")
    assert flow.mimetype == "image/svg+xml"
    assert "analysed" in flow.text


@pytest.mark.parametrize("path", ["/researcher/secrets.csv", "/researcher/.csv"])
def test_no_other_file_can_be_had(app: Flask, instance: Path, path: str) -> None:
    visitor = researcher_of(app)
    unblind(visitor)
    assert visitor.get(path).status_code == 404
    assert visitor.post("/researcher/recruits.csv", {"confirm": "yes"}).status_code == 404
    assert ask(instance, "SELECT 1 FROM records WHERE action = 'downloaded'") == []


def test_a_download_that_is_never_read_to_its_end_does_not_hold_up_participants(app: Flask) -> None:
    visitor = researcher_of(app)
    unblind(visitor)
    answer = visitor.client.get("/researcher/ratings.csv")
    person = Visitor(app)
    person.agree()
    assert person.answer(1).status_code == 303
    answer.close()


def test_who_came_from_where_is_confirmed_and_on_record(driving: Flask, instance: Path) -> None:
    participant = take_part(driving, RECRUIT)
    take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/data").text
    assert RECRUIT.external_id not in page
    assert visitor.get("/researcher/recruits.csv").status_code in {403, 404, 405}
    refused = visitor.post("/researcher/recruits.csv")
    assert (refused.status_code, "confirm that you need the ids" in refused.text) == (422, True)
    answer = visitor.post("/researcher/recruits.csv", {"confirm": "yes"})
    (line,) = csv.DictReader(io.StringIO(answer.text, newline=""))
    answer.close()
    assert (line["participant"], line["external_id"]) == (participant.code, RECRUIT.external_id)
    logged = ask(
        instance,
        "SELECT actor, content FROM records JOIN record_contents USING (number) WHERE action = 'downloaded'",
    )
    assert logged == [(NAME, f'{{"file":"{RECRUITS}"}}')]
    unblind(visitor)
    for name in FILE_NAMES:
        assert RECRUIT.external_id not in visitor.get(f"/researcher/{name}").text


def test_the_recruiters_list_is_compared(driving: Flask) -> None:
    participant = take_part(driving, RECRUIT)
    visitor = researcher_of(driving)
    theirs = f"Submission id,Participant id,Status\nx,{RECRUIT.external_id},RETURNED\ny,{'a' * 24},APPROVED\n"
    answer = send_list(visitor, theirs.encode())
    assert answer.status_code == 200
    assert downloads(services_of(driving).config.instance) == ["reconciliation"]
    assert "compared the recruiter's list" in visitor.get("/researcher/records").text.replace("&#39;", "'")
    assert "2 in the list, 1 here" in answer.text
    assert "a" * 24 in answer.text
    assert participant.code in answer.text
    for content, words in ((b"\xff\xfe", "not in UTF-8"), (b"", "choose the recruiter")):
        refused = send_list(visitor, content, "list.csv" if content else "")
        assert refused.status_code == 422
        assert words in refused.text.replace("&#39;", "'")
    assert len(downloads(services_of(driving).config.instance)) == 1
    too_long = {"data": b"x" * (6 * 1024 * 1024), "content_type": "multipart/form-data; boundary=x"}
    assert visitor.client.post("/researcher/reconcile", headers=SAME_SITE, **too_long).status_code == 413


def test_a_long_list_is_counted_whole_and_listed_in_part(driving: Flask) -> None:
    theirs = "Participant id\n" + "".join(f"{number:024x}\n" for number in range(15_000))
    page = send_list(researcher_of(driving), theirs.encode()).text
    assert "(15000)</h3>" in page
    assert "The first 200 of 15000." in page
    assert f"{199:024x}" in page
    assert f"{200:024x}" not in page
    assert len(page) < 100_000


def send_list(visitor: Visitor, content: bytes, name: str = "list.csv") -> TestResponse:
    form = {"list": (io.BytesIO(content), name)}
    return visitor.client.post(
        "/researcher/reconcile", data=form, headers=SAME_SITE, content_type="multipart/form-data"
    )


def test_the_files_hold_what_the_participants_did(driving: Flask) -> None:
    participant = take_part(driving)
    visitor = researcher_of(driving)
    unblind(visitor)
    probes, drives = rows(visitor, "probes.csv"), rows(visitor, "drives.csv")
    assert {row["participant"] for row in (*probes, *drives)} == {participant.code}
    assert [row["is_correct"] for row in probes] == ["true"] * 6
    assert [row["phase"] for row in drives].count("before") == 1
    assert [row["phase"] for row in drives].count("after") == 3
    (person,) = rows(visitor, "participants.csv")
    assert (person["language"], person["translation"]) == ("en", "original")
    items = {row["item"] for row in rows(visitor, "ratings.csv")}
    assert items == {"foresee", "likeliness", "loveliness", "general", *SATISFACTION_ITEMS}


def test_the_dashboard_is_english_whatever_the_browser_asks_for(driving: Flask) -> None:
    researcher_of(driving)
    visitor = Visitor(driving)
    for path in ("/researcher/sign-in", "/researcher/"):
        page = visitor.client.get(path, headers={"Accept-Language": "ja"}).text
        assert '<html lang="en">' in page
        sign_in(visitor)
    assert '<html lang="ja">' in visitor.client.get("/", headers={"Accept-Language": "ja"}).text
