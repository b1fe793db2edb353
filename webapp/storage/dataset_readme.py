"""The file `README.txt` of a data set: what is what, for whoever finds the folder."""

from webapp.storage.dataset_description import Covered
from webapp.storage.wanted import Wanted

_TEXT = """\
Data of {studies}
{underline}

{parts}
Only rows with mode "live" are data; "test" and "bot" are trials of the program.

What is where
-------------
dataset_description.json   What every column means, in the form of Psych-DS (schema.org's JSON-LD).
data/                      The data, exactly as stored; read these with a program. One JSON file beside each table
                           says what its columns are.
  description-ratings_data.csv        one row per rating (long)
  description-wide_data.csv           one row per participant (wide)
  description-participants_data.csv   one row per participant: times, assignment, exclusion
  description-answers_data.csv        background questions, quiz, attention checks
  description-probes_data.csv         predictions
  description-drives_data.csv         finished drives
  description-events_data.csv         actions of drives, and the logs of pages
  description-allocation_data.csv     the allocation ledger: every draw, and what it was drawn from
  description-decisions_data.csv      exclusions, corrections and help by researchers, with their reasons
  description-quality_data.csv        the declared exclusion rules, judged for everybody
spreadsheet/               The same tables to look at in a spreadsheet: with a byte order mark, and an apostrophe before
                           texts that would be run as formulas. Do not compute from these.
studies/                   For each version: its study file and its planned analysis in words, exactly as they were
                           frozen before the data. Versions whose bundle is gone have none.
consort.svg, .csv, .json   The flow of participants, as a figure, a table and for programs.
manifest.json              Rows, bytes and SHA-256 of every file; the head of the log at that moment; versions.

Reading
-------
UTF-8, commas, lines end in CR LF. An empty field means that there is no value; no text such as NA stands for it.
pandas: pandas.read_csv(path, dtype=str, keep_default_na=False, na_values=[""]), or types as in the description
R:      read.csv(path, na.strings = "", fileEncoding = "UTF-8", check.names = FALSE, colClasses = "character")
        R reads every line break within a text as a single line feed.

Who is who
----------
A participant is a random code. Ids of recruiting services are not here; they are in a file of their own, which
`xar recruits` writes and the log records. {free_text}
Reasons in the decisions are in the researchers' words. Read both before you share the data.
Exclusions and corrections are not applied: every row is there, as it was given.
"""

_WITHHELD = """Answers in participants' own words were left out: the column is_withheld
says where."""
_WITH_FREE_TEXT = """ANSWERS IN PARTICIPANTS' OWN WORDS ARE INCLUDED, and may say who somebody is."""


def readme(covered: Covered, wanted: Wanted) -> str:
    """Write the text."""
    studies = ", ".join(covered.studies) or "no study"
    parts = [
        f"{scope.study}, mode {scope.mode}: {count} {'participant' if count == 1 else 'participants'}\n"
        f"  version {scope.study_version}\n"
        for scope, count in covered.participants.items()
    ]
    return _TEXT.format(
        studies=studies,
        underline="=" * len(f"Data of {studies}"),
        parts="".join(parts) or "Nobody took part.\n",
        free_text=_WITH_FREE_TEXT if wanted.with_free_text else _WITHHELD,
    )
