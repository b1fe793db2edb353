import json
from datetime import timedelta
from pathlib import Path

import pytest

from tests.unit.storage.exported import LATER, STUDY, files_of, rows_of, texts_of, wanted_of
from tests.unit.storage.people import NOW
from tests.unit.storage.rows import write_rows
from webapp.storage.consort import Counts, Flow
from webapp.storage.consort_figure import draw_flows
from webapp.storage.database import Database
from webapp.storage.dataset import data_name, export
from webapp.storage.erasure import erase
from webapp.storage.people import exclude
from webapp.storage.scope import Scope
from webapp.storage.wanted import Wanted


def test_the_flow_adds_up_and_is_the_same_in_all_three_forms(files: dict[str, bytes]) -> None:
    (flow,) = json.loads(files["consort.json"])["flows"]
    everybody = flow["everybody"]
    assert everybody == {
        "allocated": 3,
        "dropped": {"withdrawn": 0, "screened_out": 0, "in_progress": 1},
        "completed": 2,
        "excluded": {"took part twice": 1},
        "excluded_of_those_who_dropped_out": 0,
        "analysed": 1,
    }
    assert sum(cell["allocated"] for cell in flow["arrangements"]) == 3
    assert {kind["kind"]: kind["analysed"] for kind in flow["kinds"]} == dict.fromkeys(STUDY.experiments[0].kinds, 1)
    rows = rows_of(files["consort.csv"])
    of_all = {(row["step"], row["reason"]): int(row["n"]) for row in rows if row["group"] == "all"}
    assert of_all["excluded", "took part twice"] == of_all["excluded", ""] == of_all["analysed", ""] == 1
    drawn = texts_of(files["consort.svg"])
    for line in (
        "Agreed and allocated (n = 3)",
        "Did not complete (n = 1)",
        "Completed (n = 2)",
        "took part twice (n = 1)",
    ):
        assert line in drawn


def test_whoever_was_excluded_and_had_not_finished_counts_among_those_who_dropped_out(
    live: Database, tmp_path: Path
) -> None:
    with live.read() as connection:
        (code,) = connection.exec_driver_sql("SELECT code FROM participants WHERE id = 3").one()
    exclude(live, code, "a colleague", "ann", LATER)
    export(live, tmp_path / "out", wanted_of(live), LATER)
    (flow,) = json.loads((tmp_path / "out" / "consort.json").read_text(encoding="utf-8"))["flows"]
    everybody = flow["everybody"]
    assert everybody["excluded"] == {"took part twice": 1}
    assert (everybody["excluded_of_those_who_dropped_out"], everybody["analysed"]) == (1, 1)


def test_whoever_was_erased_is_counted_and_nothing_else(live: Database, tmp_path: Path) -> None:
    with live.read() as connection:
        (code,) = connection.exec_driver_sql("SELECT code FROM participants WHERE id = 2").one()
    erase(live, code, "ann", LATER)
    export(live, tmp_path / "out", wanted_of(live), LATER)
    files = files_of(tmp_path / "out")
    (flow,) = json.loads(files["consort.json"])["flows"]
    assert (flow["erased"], flow["everybody"]["allocated"], flow["everybody"]["excluded"]) == (1, 2, {})
    assert any("erased at their own wish" in text for text in texts_of(files["consort.svg"]))
    ledger = rows_of(files[data_name("allocation.csv")])
    assert [(row["participant"] == "", row["released_why"]) for row in ledger] == [
        (False, ""),
        (True, "erased"),
        (False, ""),
    ]
    assert [name for name, content in files.items() if code.encode() in content] == []


def test_reasons_and_names_cannot_break_the_figure(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    exclude(database, "yyyyyyyyyy", "<script>&'\"" + "very long " * 30, "ann", NOW + timedelta(days=1))
    export(database, tmp_path / "out", Wanted(), LATER)
    assert any("said" in text for text in texts_of((tmp_path / "out" / "consort.svg").read_bytes()))


@pytest.mark.parametrize(("num", "are_drawn"), [(12, True), (13, False)])
def test_many_arrangements_are_left_to_the_table(num: int, are_drawn: bool) -> None:
    flow = Flow(Scope("made", "f" * 64, "bot"))
    for arrangement in range(num):
        flow.arrangements["1", arrangement, 0] = Counts()
        flow.kinds_of["1", arrangement, 0] = ("full", "random")
    flow.kinds = {("1", "full"): Counts(), ("1", "random"): Counts()}
    drawn = texts_of(draw_flows([flow]).encode())
    assert ("0/0: full · random" in drawn) is are_drawn
    assert any("consort.csv" in text for text in drawn) is not are_drawn
    assert {"full", "random"} <= set(drawn)
