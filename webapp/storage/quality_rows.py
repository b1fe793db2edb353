"""The rows of `quality.csv`: the declared exclusion rules, judged for everybody of whom they can say something."""

from collections.abc import Iterator
from typing import cast

from sqlalchemy import Connection, select

from webapp.storage.decided import duplicates, released_pages
from webapp.storage.live_plans import Plans
from webapp.storage.live_reading import Decided, read_facts
from webapp.storage.scope import Mode, Scope
from webapp.storage.streams import Row
from webapp.storage.tables import participants
from webapp.storage.wanted import Wanted
from webapp.study.protocol import Study
from webapp.study.quality import declared_rules, judge, judged_rules

_AT_ONCE = 300
"""How many participants are judged at once."""


def quality_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each participant and rule that can be judged; none for a version whose bundle is gone."""
    people = participants.c
    scopes = select(people.study, people.study_version, people.mode).distinct().where(wanted.of(participants))
    for study, version, mode in connection.execute(scopes.order_by(*scopes.selected_columns)).all():
        bundle = wanted.find_bundle(version)
        if bundle is not None and declared_rules(bundle.study.quality):
            yield from _judged(connection, bundle.study, Scope(study, version, cast("Mode", mode)))


def _judged(connection: Connection, study: Study, scope: Scope) -> Iterator[Row]:
    decided = Decided(released=released_pages(connection, scope), duplicates=duplicates(connection))
    plans = Plans(study)
    query = select(participants.c.id).where(scope.of(participants)).order_by(participants.c.id)
    ids = connection.execute(query).scalars().all()
    for first in range(0, len(ids), _AT_ONCE):
        for code, facts in read_facts(connection, plans, scope, ids[first : first + _AT_ONCE], decided):
            flags = {flag.rule: flag for flag in judge(study.quality, facts)}
            for rule in judged_rules(study.quality, facts):
                flag = flags.get(rule)
                value, declared = None if flag is None else flag.value, getattr(study.quality, rule)
                limit = None if declared is True else declared
                yield scope.study, scope.study_version, scope.mode, code, rule, value, limit, flag is not None
