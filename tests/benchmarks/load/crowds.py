"""Crowds of people sent through a server by generators in processes of their own, and what is said about them."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import quantiles
from typing import Any

from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.processes import footprint
from tests.conftest import ROOT

_PATIENCE_S = 3 * 3600


@dataclass(frozen=True, slots=True)
class Crowd:
    """What became of a crowd.

    Attributes:
        people: What the generator says of each person, as `generator.Person`.
        seconds: By kind of request, how long each took.
        took_s: From the first arrival until the last one was through.
        generator_cpu_s: Processor seconds of the generators.
        server_cpu_s: Processor seconds of the server meanwhile.
    """

    people: Sequence[Mapping[str, Any]]
    seconds: Mapping[str, Sequence[float]]
    took_s: float
    generator_cpu_s: float
    server_cpu_s: float

    @property
    def num_finished(self) -> int:
        """How many came to the end."""
        return sum(person["finished"] for person in self.people)

    @property
    def finished_per_s(self) -> float:
        """How many came to the end in a second."""
        return self.num_finished / self.took_s

    @property
    def problems(self) -> list[str]:
        """What stopped the others."""
        return [person["problem"] for person in self.people if not person["finished"]]

    @property
    def num_requests(self) -> int:
        """How many requests were answered."""
        return sum(map(len, self.seconds.values()))

    def centile_ms(self, centile: int, *kinds: str) -> float:
        """Return how many milliseconds requests of some kinds took at most, of this percentage of them."""
        taken = [second for kind in kinds or tuple(self.seconds) for second in self.seconds[kind]]
        return 1000 * quantiles(taken, n=100, method="inclusive")[centile - 1]


def send(plan: Plan, *server_pids: int, ports: Sequence[int] = ()) -> Crowd:
    """Send a crowd to a server and wait until it is through.

    Args:
        plan: What the people do. They are dealt out among the generators.
        server_pids: The server's processes, whose processor time is counted, with that of their children.
        ports: One generator sends its people to each of these; one sends all to the plan's port if there are none.
    """
    before = sum(footprint(pid).cpu_s for pid in server_pids)
    ports = ports or (plan.port,)
    num_generators = len(ports)
    plans = [
        replace(
            plan,
            port=port,
            starts=plan.starts[place::num_generators],
            at_once=len(range(place, plan.at_once, num_generators)),
            seed=plan.seed * num_generators + place,
        )
        for place, port in enumerate(ports)
    ]
    command = [sys.executable, "-m", "tests.benchmarks.load.generator"]
    generators = [
        subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in plans
    ]
    try:
        for generator, part in zip(generators, plans, strict=True):
            assert generator.stdin is not None
            generator.stdin.write(json.dumps(asdict(part)))
            generator.stdin.close()
        told = [json.loads(_read(generator)) for generator in generators]
    finally:
        for generator in generators:
            generator.kill()
            generator.wait()
    return Crowd(
        people=[person for part in told for person in part["people"]],
        seconds={kind: [second for part in told for second in part["seconds"][kind]] for kind in told[0]["seconds"]},
        took_s=max(part["took_s"] for part in told),
        generator_cpu_s=sum(part["cpu_s"] for part in told),
        server_cpu_s=sum(footprint(pid).cpu_s for pid in server_pids) - before,
    )


def _read(generator: "subprocess.Popen[str]") -> str:
    assert generator.stdout is not None
    return generator.stdout.read()
