"""The methods paragraph, ready for a paper, and the provenance of every number as tables."""

from collections.abc import Iterator, Sequence

from webapp.reports.blocks import Block, Column, Section, Table
from webapp.reports.departures import nothing_differs
from webapp.reports.formatting import counted, listed, number
from webapp.reports.origin import Origin
from webapp.reports.people import headcount
from webapp.reports.study_data import StudyData
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.quality import declared_rules

_FILES = (Column("file", "File of the data set"), Column("sha256", "SHA-256"))
_VERSIONS = (Column("name", "Program"), Column("version", "Version"))
_ASKED = (Column("option", "Option"), Column("value", "Value"))


def methods_section(data: StudyData, origin: Origin, differences: Sequence[str]) -> Section:
    """Return the methods paragraph with the files, versions and options behind the report."""
    blocks: list[Block] = [
        *methods(data, origin, differences),
        Table("input_files", "The files that were read", _FILES, tuple(sorted(origin.files.items()))),
        Table(
            "versions",
            "The programs that computed and drew",
            _VERSIONS,
            (*origin.versions.items(), ("this program's code, SHA-256", origin.code)),
        ),
        Table("options", "What was asked for", _ASKED, tuple(_option(*each) for each in sorted(origin.asked.items()))),
        "The same files, options and versions give the same bytes in every file of this report.",
    ]
    return Section("methods", "Methods and provenance", tuple(blocks))


def methods(data: StudyData, origin: Origin, differences: Sequence[str]) -> tuple[str, ...]:
    """Return the methods as paragraphs."""
    about_data, model, rest = _of_the_data(data, origin), _of_the_model(data), _of_the_rest(data)
    return (about_data, model, rest, _departed(data, differences), _of_the_programs(origin))


def methods_text(data: StudyData, origin: Origin, differences: Sequence[str]) -> bytes:
    """Return the methods as a text file, with the hash of each file that was read."""
    files = "\n".join(f"{digest}  {name}" for name, digest in sorted(origin.files.items()))
    told = "\n\n".join([*methods(data, origin, differences), f"Files that were read, with their SHA-256:\n{files}"])
    return f"{told}\n".encode()


def _of_the_data(data: StudyData, origin: Origin) -> str:
    scope = f"study {data.study}, version {data.study_version[:12] or 'not told by the data'}, mode {data.mode}"
    return " ".join([f"Data ({scope}).", headcount(data).sentence(), *_of_the_rules(data), *origin.notes])


def _of_the_rules(data: StudyData) -> list[str]:
    if data.declared is None:
        return []
    rules = declared_rules(data.declared.quality)
    if not rules:
        return ["The study file declares no rule of exclusion."]
    return [f"Rules of exclusion, declared in the study file before data were collected: {listed(list(rules))}."]


def _of_the_model(data: StudyData) -> str:
    plan = data.plan
    items = "; ".join(
        f"experiment {experiment}: {listed(list(names))}" for experiment, names in sorted(plan.items.items())
    )
    which = "declared" if plan.is_declared else "default"
    contrasts = listed([f"{each} in experiment {each.experiment}" for each in plan.contrasts]) or "none"
    return (
        f"In each experiment, each item ({items}) was analysed with a cumulative link mixed model (probit link, free "
        "thresholds, maximum likelihood by adaptive Gauss-Hermite quadrature with 11 nodes, doubled until no estimate "
        "moved by a thousandth of its standard error), with kind of explanation, layout and position as fixed effects "
        "and a random intercept per participant; effects that the design cannot tell apart were left out and named. "
        f"The {counted(len(plan.contrasts), which + ' contrast')} of kinds ({contrasts}) were tested two-sided on each "
        "item by Wald's test, held to Student's t with ratings less participants less coefficients as degrees of "
        f"freedom; the {counted(plan.num_tests, 'test')} are one family, corrected by Holm's method at the level "
        f"{number(plan.alpha)}. Differences are given in standard deviations of the latent rating (d) with 95 % "
        "confidence intervals. That kinds shift all thresholds alike was tested against thresholds of each kind's "
        "own, and that intercepts are normal by a parametric bootstrap."
    )


def _of_the_rest(data: StudyData) -> str:
    return " ".join((*_of_other_tests(data), *_of_what_people_did(data), *_of_the_people(data)))


def _of_other_tests(data: StudyData) -> Iterator[str]:
    plan = data.plan
    yield (
        "As robustness checks the same comparisons were made within participants by Wilcoxon's signed-rank test, or "
        "by the Mann-Whitney test where fewer than half of them had seen both kinds, and by paired t tests, each with "
        "Holm's correction over the family; rank-biserial correlations and standardized mean differences have 95 % "
        "intervals. The analyses of Sakai et al. (2021) were repeated in their way and are not corrected."
    )
    if plan.equivalences:
        pairs = listed([f"{each} in experiment {each.experiment}" for each in plan.equivalences])
        num_tests = sum(len(plan.items_of(each)) for each in plan.equivalences)
        yield (
            f"Equivalence ({pairs}) was tested by two one-sided paired t tests within a margin of "
            f"\N{PLUS-MINUS SIGN}{plan.margin:g} rating points, with Holm's correction over "
            f"{counted(num_tests, 'test')}."
        )


def _of_what_people_did(data: StudyData) -> Iterator[str]:
    has_drives, has_probes = (table is not None and not table.empty for table in (data.drives, data.probes))
    if has_drives:
        yield (
            "Whether a drive reached the goal was analysed with mixed logistic models with kind, layout and position "
            "as effects and a random intercept per participant; the time to the goal, in actions over the fewest "
            "possible, with proportional hazards models stratified by layout, Efron's ties and errors robust within "
            "participants, whoever gave up staying at risk to the limit."
        )
    if has_probes:
        yield "Whether predictions of the agent's actions were right was analysed with mixed logistic models."
    if has_drives or has_probes:
        yield (
            "Calibration of felt against measured understanding was described by intervals robust within "
            "participants, areas under the curve (percentile bootstrap of 2,000 resamples of participants), "
            "correlations within participants and mixed logistic models of being right on the rating."
        )


def _of_the_people(data: StudyData) -> Iterator[str]:
    if data.ratings["item"].isin(SATISFACTION_ITEMS).any():
        yield (
            "The reliability of the satisfaction scale was estimated by Cronbach's alpha (Feldt's interval) and "
            "McDonald's omega (percentile bootstrap of 500 resamples of participants)."
        )
    if data.everybody is not None:
        yield "Differential drop-out was tested on started trials by kind of explanation."


def _departed(data: StudyData, differences: Sequence[str]) -> str:
    if not differences:
        return nothing_differs(data)
    return " ".join(["Deviations from the plan:", *differences])


def _of_the_programs(origin: Origin) -> str:
    names = {"python": "Python", "numpy": "NumPy", "scipy": "SciPy", "matplotlib": "Matplotlib"}
    used = [f"{names.get(name, name)} {told}" for name, told in origin.versions.items() if name != "xar"]
    return (
        f"Computed with xar {origin.versions['xar']} (code SHA-256 {origin.code[:12]}), {listed(used)}. Input: "
        f"{counted(len(origin.files), 'file')}, together SHA-256 {origin.input_hash[:12]}."
    )


def _option(name: str, value: object) -> tuple[str, str]:
    told = {True: "yes", False: "no", None: "not given"}.get(value) if isinstance(value, bool | None) else str(value)
    return name.replace("_", " "), str(told)
