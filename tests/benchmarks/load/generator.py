"""The load generator, a process of its own: many people at once, each with a browser and a ledger.

It reads a plan as JSON from its standard input and writes what happened as JSON to its standard output. A person's
ledger takes an answer only after the response that acknowledges it was read to its end.
"""

import asyncio
import json
import random
import resource
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from tests.benchmarks.load.browser import Browser, CutOffError, Response
from tests.benchmarks.load.page_forms import find_form, find_pictures

MAX_PAGES = 60
OK = 200


@dataclass(frozen=True, slots=True)
class Plan:
    """What a generator is asked to do.

    Attributes:
        host: Such as 127.0.0.1.
        port: Where the server listens.
        starts: The address with which each person starts.
        end: A person whose address holds this has finished.
        at_once: How many people are there at once; whoever finishes makes room for the next one.
        think_s: Mean seconds between a page and its answer, drawn evenly from half to one and a half of it.
        arrive_s: The first people arrive evenly within so many seconds.
        pictures: Whether each picture is loaded when it is first seen.
        until_s: Nobody new comes after so many seconds; 0 for no such limit.
        seed: Decides what people answer.
    """

    host: str
    port: int
    starts: Sequence[str]
    end: str
    at_once: int
    think_s: float = 0.0
    arrive_s: float = 0.0
    pictures: bool = True
    until_s: float = 0.0
    seed: int = 1


@dataclass
class Person:
    """What became of one person.

    Attributes:
        start: The address that they began with.
        cookies: Those of their browser at the end.
        ledger: Acknowledged answers: the page's address, the field, the value.
        finished: Whether they came to the end.
        problem: What stopped them, if anything did.
        num_requests: How many they sent.
    """

    start: str
    cookies: dict[str, str] = field(default_factory=dict)
    ledger: list[tuple[str, str, str]] = field(default_factory=list)
    finished: bool = False
    problem: str = ""
    num_requests: int = 0


async def run(plan: Plan) -> dict[str, Any]:
    """Let everybody take part; return who did what and how long it took."""
    waiting = list(enumerate(plan.starts))[::-1]
    people: list[Person] = []
    seconds: dict[str, list[float]] = {"page": [], "post": [], "picture": []}
    began, cpu = time.perf_counter(), time.process_time()

    async def one_after_the_other(place: int) -> None:
        await asyncio.sleep(plan.arrive_s * place / plan.at_once)
        while waiting and not (plan.until_s and time.perf_counter() - began > plan.until_s):
            number, start = waiting.pop()
            browser = Browser(plan.host, plan.port)
            async with browser:
                people.append(await take_part(plan, browser, start, random.Random(f"{plan.seed} {number}")))
            for kind, taken in browser.seconds.items():
                seconds[kind] += taken

    await asyncio.gather(*(one_after_the_other(place) for place in range(plan.at_once)))
    took = time.perf_counter() - began
    return {
        "people": [asdict(person) for person in people],
        "seconds": seconds,
        "took_s": took,
        "cpu_s": time.process_time() - cpu,
    }


async def take_part(plan: Plan, browser: Browser, start: str, rng: random.Random) -> Person:
    """Go from a start address to the end."""
    person = Person(start)
    try:
        await _walk(plan, browser, person, rng)
    except CutOffError as problem:
        person.problem = str(problem)
    person.cookies = browser.cookies
    person.num_requests = sum(map(len, browser.seconds.values()))
    return person


async def _walk(plan: Plan, browser: Browser, person: Person, rng: random.Random) -> None:
    seen: set[str] = set()
    address = person.start
    for _ in range(MAX_PAGES):
        address, page = await _follow(browser, address, await browser.get(address))
        if plan.pictures:
            for picture in find_pictures(page.text):
                if picture not in seen:
                    seen.add(picture)
                    _expect(await browser.get(picture, "picture"), picture)
        if plan.end in address:
            person.finished = True
            return
        form = find_form(page.text)
        if form is None:
            raise CutOffError(f"{address} has no form")
        if plan.think_s:
            await asyncio.sleep(plan.think_s * rng.uniform(0.5, 1.5))
        whole, chosen = form.filled(rng)
        target = form.action or address
        response = await browser.post(target, whole)
        if not response.leads_on:
            raise CutOffError(f"POST {target} was answered with {response.status}")
        person.ledger += [(target, name, value) for name, value in chosen.items()]
        address = response.location
    raise CutOffError(f"no end after {MAX_PAGES} pages")


async def _follow(browser: Browser, address: str, response: Response) -> tuple[str, Response]:
    for _ in range(5):
        if not response.leads_on:
            break
        address = response.location
        response = await browser.get(address)
    _expect(response, address)
    return address, response


def _expect(response: Response, address: str) -> None:
    if response.status != OK:
        raise CutOffError(f"GET {address.split('?', maxsplit=1)[0]} was answered with {response.status}")


def main() -> None:
    """Do what the plan on the standard input says."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    plan = Plan(**json.load(sys.stdin))
    json.dump(asyncio.run(run(plan)), sys.stdout)


if __name__ == "__main__":
    main()
