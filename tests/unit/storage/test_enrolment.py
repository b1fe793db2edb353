from collections import Counter
from datetime import datetime

import pytest
from sqlalchemy import select

from tests.unit.storage.people import DRIVING, NOW, STUDY, at_once, count, enrol_somebody, pages_of
from webapp.storage.database import Database
from webapp.storage.enrolment import AlreadyTookPartError, Enrolment, enrol, find_recruit
from webapp.storage.participants import Participant, find_participant, find_trials, hash_token
from webapp.storage.scope import Mode
from webapp.storage.tables import arrangements, participants, recruits, trials
from webapp.study.counterbalancing import layout_orders
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit

RECRUIT = Recruit("prolific", "0123456789abcdef01234567", "fedcba987654321001234567", "session12345")


def uses(database: Database, mode: Mode = "test") -> dict[str, Counter[int]]:
    query = select(arrangements.c.experiment, arrangements.c.arrangement).join(participants)
    found = {experiment.id: Counter[int]() for experiment in STUDY.experiments}
    with database.read() as connection:
        for experiment, arrangement in connection.execute(query.where(participants.c.mode == mode)):
            found[experiment][arrangement] += 1
    return found


def cells(database: Database) -> Counter[tuple[int, int]]:
    """How often each pair of an arrangement and an order of the layouts was given out."""
    with database.read() as connection:
        rows = connection.execute(select(arrangements.c.arrangement, arrangements.c.layout_order))
        return Counter((arrangement, order) for arrangement, order in rows)


def test_a_consent_stores_the_participant_with_arrangements_and_trials(database: Database) -> None:
    participant = enrol_somebody(database)
    planned = find_trials(database, participant)
    assert (participant.num_stored, participant.num_pages) == (0, len(pages_of(database, participant)))
    for experiment in STUDY.experiments:
        own = [trial for trial in planned if trial.experiment == experiment.id]
        assert tuple(trial.layout for trial in own) == experiment.layouts
        assert {trial.kind for trial in own} == set(experiment.kinds)
    assert find_participant(database, participant.token_hash) == participant


@pytest.mark.parametrize(
    ("study", "language", "translation"), [(STUDY, "en", "original"), (DRIVING, "ja", "unvalidated")]
)
@pytest.mark.parametrize("guardian_agreed", [None, False, True])
def test_a_consent_stores_what_was_read_and_declared(
    database: Database, study: Study, language: str, translation: str, guardian_agreed: bool | None
) -> None:
    participant = enrol(database, Enrolment(study, "v1", "live", "hash", language, guardian_agreed), NOW)
    assert participant.language == language
    with database.read() as connection:
        row = connection.execute(select(participants)).one()
    assert (row.language, row.translation, row.guardian_agreed) == (language, translation, guardian_agreed)
    assert row.consent_version == study.consent_version


def test_every_arrangement_is_used_equally_often_after_every_consent(database: Database) -> None:
    for num_consents in range(1, 14):
        enrol_somebody(database)
        found = uses(database)
        for experiment, num_arrangements in (("1", 6), ("2", 2)):
            counts = [found[experiment][arrangement] for arrangement in range(num_arrangements)]
            assert sum(counts) == num_consents
            assert max(counts) - min(counts) <= 1


def test_orders_of_the_layouts_are_used_equally_often_and_go_with_every_arrangement(database: Database) -> None:
    for num_consents in range(1, 37):
        enrol_somebody(database, study=DRIVING)
        found = cells(database)
        for place in (0, 1):
            counts = Counter(dict.fromkeys(range(6), 0))
            for cell, number in found.items():
                counts[cell[place]] += number
            assert counts.total() == num_consents
            assert max(counts.values()) - min(counts.values()) <= 1
    assert max(found.values()) <= 4


def test_trials_come_in_the_order_that_was_drawn(database: Database) -> None:
    (experiment,) = DRIVING.experiments
    orders = layout_orders(experiment)
    for _ in range(6):
        participant = enrol_somebody(database, study=DRIVING)
        query = select(arrangements.c.layout_order).where(arrangements.c.participant_id == participant.id)
        with database.read() as connection:
            order = orders[connection.execute(query).scalar_one()]
        shown = [trial.layout for trial in find_trials(database, participant)]
        assert shown == [experiment.layouts[place] for place in order]


def test_fixed_layouts_have_the_one_order_of_the_study_file(database: Database) -> None:
    for _ in range(3):
        enrol_somebody(database)
    with database.read() as connection:
        assert set(connection.execute(select(arrangements.c.layout_order)).scalars()) == {0}


def test_test_runs_and_other_versions_use_up_nothing(database: Database) -> None:
    # Three are half of the arrangements: were they counted, the six that follow would hardly ever be all different.
    for _ in range(3):
        enrol_somebody(database, mode="test", version="v1")
        enrol_somebody(database, mode="live", version="v0")
        enrol_somebody(database, mode="bot", version="v2")
    others: tuple[tuple[Mode, str], ...] = (("live", "v1"), ("test", "v0"), ("live", "v2"))
    for mode, version in others:
        own = {enrol_somebody(database, mode=mode, version=version).id for _ in range(6)}
        query = select(arrangements.c.arrangement).where(arrangements.c.participant_id.in_(own))
        with database.read() as connection:
            found = connection.execute(query.where(arrangements.c.experiment == "1")).scalars().all()
        assert sorted(found) == [0, 1, 2, 3, 4, 5]


def test_fifty_simultaneous_consents_stay_balanced(database: Database) -> None:
    at_once(50, lambda _: enrol_somebody(database))
    for experiment, num_arrangements in (("1", 6), ("2", 2)):
        counts = [uses(database)[experiment][arrangement] for arrangement in range(num_arrangements)]
        assert sum(counts) == 50
        assert max(counts) - min(counts) <= 1


def test_the_same_token_enrols_once(database: Database) -> None:
    assert enrol_somebody(database, cookie="mine") == enrol_somebody(database, cookie="mine")
    assert count(database, participants) == 1
    assert count(database, trials) == 5


def test_draws_belong_to_the_random_kind_and_differ_between_participants(database: Database) -> None:
    draws = set()
    for _ in range(40):
        for trial in find_trials(database, enrol_somebody(database)):
            assert (trial.draw is not None) == (trial.kind == "random")
            draws |= {trial.draw} - {None}
    assert len(draws) > 5
    assert draws <= set(range(10))


def test_times_without_a_zone_are_refused(database: Database) -> None:
    enrolment = Enrolment(STUDY, "v1", "test", hash_token("any"), "en")
    with pytest.raises(Exception, match="no time zone"):
        enrol(database, enrolment, datetime(2031, 1, 1))  # noqa: DTZ001 - that is the point
    assert count(database, participants) == 0


def test_whom_a_recruiter_sent_is_remembered_apart_from_those_who_came_by_themselves(database: Database) -> None:
    sent, alone = enrol_somebody(database, recruit=RECRUIT), enrol_somebody(database)
    only_a_label = enrol_somebody(database, recruit=Recruit("label", "room-2"))
    assert find_recruit(database, sent) == RECRUIT
    assert find_recruit(database, alone) is None
    assert find_recruit(database, only_a_label) == Recruit("label", "room-2", None, None)
    assert count(database, recruits) == 2


def test_the_same_recruit_takes_part_once_and_a_second_attempt_stores_nothing(database: Database) -> None:
    first = enrol_somebody(database, recruit=RECRUIT, cookie="first")
    with pytest.raises(AlreadyTookPartError):
        enrol_somebody(database, recruit=RECRUIT, cookie="second")
    again = Recruit("prolific", RECRUIT.external_id, RECRUIT.external_study, "session67890")
    with pytest.raises(AlreadyTookPartError):
        enrol_somebody(database, recruit=again, cookie="third", version="v2")
    assert enrol_somebody(database, recruit=RECRUIT, cookie="first") == first
    assert (count(database, participants), count(database, recruits)) == (1, 1)
    assert count(database, trials) == 5


def test_a_recruit_may_take_part_in_another_study_and_again_once_it_is_live(database: Database) -> None:
    enrol_somebody(database, recruit=RECRUIT)
    enrol_somebody(database, recruit=RECRUIT, mode="live")
    enrol_somebody(database, recruit=RECRUIT, study=DRIVING)
    enrol_somebody(database, recruit=Recruit("label", RECRUIT.external_id))
    assert count(database, recruits) == 4


@pytest.mark.parametrize("is_one_browser", [True, False])
def test_of_twenty_simultaneous_consents_of_one_recruit_one_is_stored(database: Database, is_one_browser: bool) -> None:
    def agree(number: int) -> Participant | None:
        cookie = "the same" if is_one_browser else f"window {number}"
        try:
            return enrol_somebody(database, recruit=RECRUIT, cookie=cookie)
        except AlreadyTookPartError:
            return None

    enrolled = [participant for participant in at_once(20, agree) if participant is not None]
    assert len(enrolled) == (20 if is_one_browser else 1)
    assert len({participant.id for participant in enrolled}) == 1
    assert (count(database, participants), count(database, recruits)) == (1, 1)
    assert sum(uses(database)["1"].values()) == 1
