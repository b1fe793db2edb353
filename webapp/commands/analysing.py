"""`xar analyse`: a data set as a report."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from webapp.command_line import CommandError
from webapp.commands.runs import stoppable

if TYPE_CHECKING:
    from webapp.reports.analysis import Analysis
    from webapp.reports.assembly import Assembled


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="EXPORT_DIR")
@click.option("--study", metavar="NAME", help="The study; the only one in the data if not given.")
@click.option("--version", metavar="HASH", help="Its version, or the start of its hash; the only one if not given.")
@click.option("--mode", type=click.Choice(["live", "test", "bot"]), help="Of these participants; live if not given.")
@click.option("--run", "run_name", metavar="NAME", help="The name of the report's folder; if not given, from the data.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    metavar="DIR",
    help="The folder of results.",
)
@click.option("--include-incomplete", is_flag=True, help="Also people who did not complete the study.")
@click.option("--changed-data-ok", is_flag=True, help="Also files that were changed after the export.")
def analyse(
    folder: Path,
    study: str | None,
    version: str | None,
    mode: str | None,
    run_name: str | None,
    out: Path,
    *,
    include_incomplete: bool,
    changed_data_ok: bool,
) -> None:
    """Analyse the data set EXPORT_DIR that `xar export` wrote, and write the report into results/analysis/NAME.

    Who is excluded follows from the study file and from what researchers decided. The same input gives the same bytes.
    A report of the same input that is there already is not made again, and nothing is overwritten.
    """
    with stoppable():
        from webapp.reports.analysis import prepare
        from webapp.reports.writing import REPORT, is_there, name_of_run, write
        from webapp.runs.run_folders import check_run_name

        with _refusals():
            analysis = prepare(
                folder, study, version, mode, include_incomplete=include_incomplete, changed_data_ok=changed_data_ok
            )
            data, origin = analysis.data, analysis.origin
            target = out / "analysis" / check_run_name(name_of_run(data, origin) if run_name is None else run_name)
            if is_there(target, origin):
                click.echo(f"The report on these data is there already: {target / REPORT}")
                return
            with stoppable(target, *target.parents):
                made = write(target, data, origin, analysis.report)
    _tell(analysis, made, target / REPORT)


def _tell(analysis: "Analysis", made: "Assembled", report: Path) -> None:
    """Print who was analysed, what the planned comparisons found, and where the report is."""
    from webapp.reports.people import headcount
    from webapp.reports.summary import answer, in_words

    data = analysis.data
    click.echo(f"{headcount(data).sentence()}\n\n{answer(data, made.found)}")
    for finding in made.found:
        told = in_words(finding, data.plan.alpha)
        click.echo(f"  experiment {finding.contrast.experiment}, {finding.item}: {finding.contrast}: {told}")
    if made.differences:
        click.echo("\nWhat differs from the plan:")
    for difference in made.differences:
        click.echo(f"  {difference}")
    click.echo(f"\nThe report: {report}")


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what is refused into one line and exit status 2; several problems of files get a line each before it."""
    from webapp.reports.reading import DataSetError
    from webapp.runs.run_folders import RunFolderError
    from webapp.study.problems import StudyError

    try:
        yield
    except (DataSetError, StudyError) as error:
        if len(error.problems) == 1:
            raise CommandError(error.problems[0]) from error
        for problem in error.problems:
            click.echo(problem, err=True)
        raise CommandError(f"the data cannot be analysed; {len(error.problems)} problems are listed above") from error
    except RunFolderError as error:
        raise CommandError(str(error)) from error
