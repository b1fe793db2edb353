"""The command `xar`: verbs only. Each loads what it needs when it runs, so that a quick verb stays quick."""

import os

import click

from webapp.command_line import OneLineErrors, refusals
from webapp.commands.administering import admin
from webapp.commands.analysing import analyse
from webapp.commands.botting import bots
from webapp.commands.comparing import compare
from webapp.commands.doctoring import doctor
from webapp.commands.explaining import explain
from webapp.commands.exporting import export, reconcile, recruits
from webapp.commands.operating import backup, migrate, restore
from webapp.commands.powering import power
from webapp.commands.recording import erase, replay, verify_log
from webapp.commands.rehearsing import rehearse
from webapp.commands.simulating import simulate
from webapp.commands.studying import study, study_refusals


@click.group(cls=OneLineErrors, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(package_name="xar", prog_name="xar")
def main() -> None:
    """Explain what a learned agent does, and study how people understand it."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # Networks as small as ours get many times slower with more threads.


@main.command()
@click.argument("study", required=False)
def build(study: str | None) -> None:
    """Train and explain the agents of STUDY and build the bundle that is served; nothing is done twice.

    STUDY is the name of a declared study, or a folder that holds a study file (XAR_STUDY).
    """
    from rich.console import Console

    from webapp.config import read_config
    from webapp.stimuli.build import build as build_bundle
    from webapp.stimuli.console import render_report, shown_progress
    from webapp.stimuli.sources import find_study
    from webapp.storage.instance import prepare_instance

    with study_refusals():
        config = read_config(os.environ)
        folder = find_study(config.study if study is None else study)
        prepare_instance(config.instance)
        with shown_progress(Console(stderr=True)) as progress:
            built = build_bundle(folder, config.instance, progress)
    Console().print(render_report(built))


@main.command()
@click.option("--host", help="The address to listen on; this machine alone unless told otherwise (XAR_HOST).")
@click.option("--port", type=click.IntRange(0, 65535), help="The port to listen on, 8000 if not given (XAR_PORT).")
@click.option("--study", help="The study to serve (XAR_STUDY).")
@click.option(
    "--workers",
    type=click.IntRange(1, 64),
    help="How many processes serve, from PostgreSQL (WEB_CONCURRENCY); 1 if not given.",
)
@click.option("--live", is_flag=True, help="Collect real data: answers are not marked as a test.")
def serve(host: str | None, port: int | None, study: str | None, workers: int | None, *, live: bool) -> None:
    """Serve the participant pages and the dashboard until stopped."""
    from webapp.app import serve as run_server
    from webapp.config import read_config
    from webapp.workers import serve_with_workers

    with refusals():
        config = read_config(os.environ, live=live, host=host, port=port, study=study, workers=workers)
        if config.workers > 1:
            serve_with_workers(config)
        run_server(config, announce=click.echo)


main.add_command(admin)
main.add_command(bots)
main.add_command(backup)
main.add_command(restore)
main.add_command(migrate)
main.add_command(doctor)
main.add_command(erase)
main.add_command(verify_log)
study.add_command(replay)
main.add_command(study)
main.add_command(explain)
main.add_command(compare)
main.add_command(simulate)
main.add_command(power)
main.add_command(rehearse)
main.add_command(export)
main.add_command(analyse)
main.add_command(recruits)
main.add_command(reconcile)
