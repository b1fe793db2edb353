"""What is stored of a participant, read back entry by entry."""

from tests.unit.storage.people import DRIVING, NOW, enrol_somebody, page_of_kind, send, walk, walk_to
from webapp.storage.answers import store_step
from webapp.storage.database import Database
from webapp.storage.read_back import NOT_MEASURED, read_back
from webapp.study.answers import DriveStep, PageContent
from webapp.study.questionnaire import Ratings


def test_a_rating_page_is_its_ratings_and_the_page(database: Database) -> None:
    participant = enrol_somebody(database)
    walk(database, participant, 2)
    items = ("general", "likeliness", "loveliness")
    ratings = Ratings(dict.fromkeys(items, 4), {"general": 1200, "likeliness": None, "loveliness": 0})
    send(database, participant, 3, content=PageContent(ratings=ratings))
    found = read_back(database, participant)
    assert set(found) == {1, 2, 3}
    assert found[1] == [("page",)]
    rated = [("rating", item, "4", time) for item, time in zip(items, ("1200", NOT_MEASURED, "0"), strict=True)]
    assert sorted(found[3]) == [("page",), *rated]


def test_everybody_has_their_own(database: Database) -> None:
    first, second = enrol_somebody(database), enrol_somebody(database)
    send(database, first, 1)
    assert read_back(database, second) == {}


def test_an_unfinished_drive_is_its_actions_without_the_page(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "practice", DRIVING)
    store_step(database, participant, page, DriveStep(1, "left", 300), NOW)
    assert read_back(database, participant)[page.number] == [("step", "1", "left", "300")]


def test_answers_predictions_and_drives_are_there_too(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    last = walk_to(database, participant, "drive", DRIVING)
    found = read_back(database, participant)
    probe = page_of_kind(database, participant, "probe", DRIVING)
    assert {entry[0] for entry in found[probe.number]} == {"page", "prediction"}
    assert {len(entry) for entry in found[probe.number]} == {1, 5}
    practice = page_of_kind(database, participant, "practice", DRIVING)
    assert {entry[0] for entry in found[practice.number]} >= {"page", "drive"}
    quiz = page_of_kind(database, participant, "quiz", DRIVING)
    assert found[quiz.number][0] == ("page",)
    assert last.number not in found
