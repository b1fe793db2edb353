"""What processes take, read from /proc: processor seconds, memory, open files. A server counts with its children."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

KILOBYTE = 1024
_TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Footprint:
    """What a process and its children have at one moment.

    Attributes:
        cpu_s: Processor seconds since they began, user and system.
        largest_rss: Resident bytes of the largest of them.
        pss: Bytes of all of them, shared pages divided among those that share them.
        num_files: Open file descriptors of all of them.
    """

    cpu_s: float
    largest_rss: int
    pss: int
    num_files: int


def footprint(pid: int) -> Footprint:
    """Measure a process with its children."""
    family = list(_family(pid))
    return Footprint(
        cpu_s=sum(map(_cpu_s, family)),
        largest_rss=max(_field(one, "status", "VmRSS") for one in family),
        pss=sum(_field(one, "smaps_rollup", "Pss") for one in family),
        num_files=sum(len(list(Path(f"/proc/{one}/fd").iterdir())) for one in family),
    )


def _family(pid: int) -> Iterator[int]:
    yield pid
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text(encoding="ascii").split():
            yield from _family(int(child))


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _field(pid: int, file: str, name: str) -> int:
    for line in Path(f"/proc/{pid}/{file}").read_text(encoding="ascii").splitlines():
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) * KILOBYTE
    raise LookupError(f"/proc/{pid}/{file} has no {name}")
