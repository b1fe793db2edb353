"""A network that loses answers: `python -m tests.faults.lossy_network [--full]`.

Between browser and server stands a proxy that delays, cuts connections before a form arrives, and drops the answer
after the server has stored the form. The sender cannot tell the two apart and sends again: nothing may be lost, and
nothing stored twice.
"""

import argparse
import asyncio
import random
import re
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from tests.faults.client import Browser, take_part
from tests.faults.oracle import Ledger, bound, evidence, judge, stored_sheets
from tests.web.bundles import read_study, write_bundle
from tests.web.people import NUM_PAGES
from tests.web.servers import serving
from webapp.storage.database import open_database

FULL, SHORT = 500, 60
"""How many forms whose answer is dropped."""

_SENDERS = 6


@dataclass
class Proxy:
    """A proxy to a server on this machine, one request to a connection.

    Attributes:
        server_port: Where the server listens.
        drops: The share of forms whose answer is dropped after the server gave it.
        cuts: The share of forms that never reach the server.
        delays_s: The least and the longest delay of a request.
        seed: Decides on each.
        drop_next: So many answers to forms are dropped whatever the shares say.
        num_dropped: How many answers were dropped.
        num_cut: How many forms were cut off.
    """

    server_port: int
    drops: float = 0.0
    cuts: float = 0.0
    delays_s: tuple[float, float] = (0.0, 0.0)
    seed: int = 1
    drop_next: int = 0
    num_dropped: int = 0
    num_cut: int = 0
    port: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self._chooser = random.Random(self.seed)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Take requests for as long as the context lasts."""
        loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_forever, daemon=True)
        thread.start()
        # Within its own thread: Playwright has a loop of its own in the one of the tests.
        server = asyncio.run_coroutine_threadsafe(asyncio.start_server(self._pass_on, "127.0.0.1", 0), loop).result(30)
        self.port = server.sockets[0].getsockname()[1]
        try:
            yield
        finally:
            asyncio.run_coroutine_threadsafe(_close(server), loop).result(30)
            loop.call_soon_threadsafe(loop.stop)
            thread.join()
            loop.close()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
            head = await reader.readuntil(b"\r\n\r\n")
            length = re.search(rb"(?i)\r\ncontent-length: *(\d+)", head)
            body = await reader.readexactly(int(length[1]) if length else 0)
            is_form = head.startswith(b"POST ")
            await asyncio.sleep(self._chooser.uniform(*self.delays_s))
            if is_form and self._chooser.random() < self.cuts:
                self.num_cut += 1
            else:
                answer = await self._answer(head, body)
                if is_form and (self.drop_next > 0 or self._chooser.random() < self.drops):
                    self.num_dropped += 1
                    self.drop_next -= self.drop_next > 0
                else:
                    writer.write(answer)
                    await writer.drain()
                    writer.close()
                    await writer.wait_closed()
                    return
        writer.transport.abort()

    async def _answer(self, head: bytes, body: bytes) -> bytes:
        """Return all that the server says."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.server_port)
        once = re.sub(rb"(?i)\r\nconnection:[^\r]*", b"", head[:-4]) + b"\r\nConnection: close\r\n\r\n"
        writer.write(once + body)
        await writer.drain()
        answer = await reader.read()
        writer.close()
        await writer.wait_closed()
        return answer


async def _close(server: asyncio.Server) -> None:
    server.close()
    mine = asyncio.current_task()
    others = [task for task in asyncio.all_tasks() if task is not mine]
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of it.

    Attributes:
        line: The evidence, as JSON.
        is_clean: Whether nothing was lost, changed, doubled or made up.
        num_dropped: How many answers were dropped after the server gave them.
        num_acknowledged: How many forms were acknowledged in the end.
    """

    line: str
    is_clean: bool
    num_dropped: int
    num_acknowledged: int


def lose_answers(instance: Path, num_dropped: int, delays_s: tuple[float, float] = (0.0, 0.02)) -> Outcome:
    """Let people take part until so many answers were dropped, and compare what they know with what is stored.

    Args:
        instance: A folder with a bundle of the study, and no database.
        num_dropped: How many answers to drop at least.
        delays_s: How long a request is under way.
    """
    ledger = Ledger()
    with serving(instance) as server:
        proxy = Proxy(server.port, drops=0.45, cuts=0.1, delays_s=delays_s)
        with proxy.running(), ThreadPoolExecutor(_SENDERS) as pool:
            list(pool.map(lambda seed: _take_part(proxy, ledger, seed, num_dropped), range(_SENDERS)))
        server.stop()
    with open_database(instance / "xar.sqlite3", make=False) as database, database.read() as connection:
        verdict = judge(ledger.acknowledged, ledger.sent, stored_sheets(connection))
    told = len(ledger.acknowledged)
    counts = {"acknowledged": told, "dropped": proxy.num_dropped, "cut": proxy.num_cut, **verdict.to_json()}
    line = evidence("lossy network", counts, bound=bound(told))
    return Outcome(line, verdict.is_clean, proxy.num_dropped, told)


def _take_part(proxy: Proxy, ledger: Ledger, seed: int, num_dropped: int) -> None:
    rng = random.Random(seed)
    while proxy.num_dropped < num_dropped:
        browser = Browser(proxy.port, patience_s=60.0)
        take_part(browser, ledger, rng, NUM_PAGES)
        browser.close()


def main() -> int:
    """Print the evidence; return 0 if it is clean."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help=f"{FULL} dropped answers and 400 +- 200 ms, not {SHORT}")
    is_full = parser.parse_args().full
    with tempfile.TemporaryDirectory() as scratch:
        instance = Path(scratch) / "instance"
        write_bundle(instance, read_study())
        outcome = lose_answers(instance, FULL if is_full else SHORT, (0.2, 0.6) if is_full else (0.0, 0.02))
        shutil.rmtree(instance)
    print(outcome.line)
    return 0 if outcome.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
