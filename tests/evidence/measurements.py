"""What is measured and with which command: F1 to F20 and the load; the order is that of docs/evidence.md."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measurement:
    """One row of the evidence.

    Attributes:
        id: Such as F1.
        what: What is done to the program, in a few words.
        results: The names of the files in results/evidence that tell of it; several where editions are tested apart.
        command: The command that measures it in full, without `python -m`; empty if there is none yet.
    """

    id: str
    what: str
    results: tuple[str, ...]
    command: str


FAULTS: Sequence[Measurement] = (
    Measurement("F1", "kill -9 of workers and server", ("kills",), "tests.faults.kills --full"),
    Measurement("F2", "power cut", ("power_cut",), "tests.faults.power_cut --full"),
    Measurement("F3", "the flush comes before the answer", ("flushes",), "tests.faults.flushes --full"),
    Measurement("F4", "PostgreSQL killed", ("postgres_kills",), "tests.faults.postgres_kills --full"),
    Measurement("F5", "disk full", ("disk_full",), "tests.faults.disk_full --full"),
    Measurement("F6", "read-only database or folder", ("read_only",), "tests.faults.read_only --full"),
    Measurement("F7", "errors of the disk", ("disk_errors",), "tests.faults.disk_errors --full"),
    Measurement("F8", "the clock jumps", ("clock",), "tests.faults.clock --full"),
    Measurement("F9", "two tabs, double clicks, back, reload", ("gestures",), "tests.faults.gestures --full"),
    Measurement("F10", "replayed, reordered and skipped pages", ("replay",), "tests.faults.replay --full"),
    Measurement("F11", "slow and lossy network", ("lossy_network",), "tests.faults.lossy_network --full"),
    Measurement("F12", "restarts under load", ("restarts",), "tests.faults.restarts --full"),
    Measurement("F13", "simultaneous starts", ("assignment",), "tests.faults.assignment --full --both"),
    Measurement("F14", "abandoned places", ("abandoned",), "tests.faults.abandoned --full"),
    Measurement("F15", "two requests behind one lock", ("lock",), "tests.faults.lock --full"),
    Measurement("F16", "backup while writing", ("backups",), "tests.faults.backups --full"),
    Measurement("F17", "migration, killed half-way", ("migrations",), "tests.faults.migrations --full"),
    Measurement("F18", "what a server refuses to start with", ("gates",), "tests.faults.gates --full"),
    Measurement("F19", "export while people answer", ("export_under_load",), "tests.benchmarks.export_under_load"),
    Measurement("F20", "soak", ("long_soak",), "tests.benchmarks.long_soak --full"),
)
LOAD: Sequence[Measurement] = (
    Measurement("L1", "beside oTree on SQLite", ("throughput",), "tests.benchmarks.throughput --no-crowds"),
    Measurement("L2", "500 and 1,000 people at once", ("crowds",), "tests.benchmarks.throughput --no-peer"),
    Measurement("L3", "200 people at human pace", ("human_pace",), "tests.benchmarks.human_pace --full"),
    Measurement("L4", "a burst of 100 arrivals", ("arrival_burst",), "tests.benchmarks.arrival_burst"),
    Measurement(
        "L5",
        "beside oTree on PostgreSQL, two processes each",
        ("throughput_postgres",),
        "tests.benchmarks.throughput --no-crowds --postgres",
    ),
    Measurement(
        "L6",
        "500 and 1,000 people at once, on PostgreSQL",
        ("crowds_postgres",),
        "tests.benchmarks.throughput --no-peer --postgres",
    ),
)
