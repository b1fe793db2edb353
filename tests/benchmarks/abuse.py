"""How much others notice of one hostile client, on the server alone: beside slow connections and large bodies."""

import http.client
import socket
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from tests.web.bundles import read_study, write_bundle
from tests.web.servers import serving
from tests.web.test_abuse import MANY_BYTES, MOST_GROWTH_KB, POST, pour, resident_kb

NUM_REQUESTS = 300
NUM_ROUNDS = 5
MOST_TIMES = 2.0
LONGEST_REFUSAL_S = 1.0
LEAST_MS = 5.0
"""Below this, twice as long is chance."""


def main() -> int:
    """Measure, print a table, and return 1 if others noticed more than they may."""
    with tempfile.TemporaryDirectory() as folder:
        write_bundle(Path(folder) / "instance", read_study())
        with serving(Path(folder) / "instance") as server:
            p95_ms(server.port)
            rounds = [_round(server.port) for _ in range(NUM_ROUNDS)]
            medians = [statistics.median(column) for column in zip(*rounds, strict=True)]
            alone, *beside = medians
            limit = MOST_TIMES * max(alone, LEAST_MS)
            print(f"p95 of {NUM_REQUESTS} welcome pages, median of {NUM_ROUNDS} rounds: {alone:.1f} ms")
            for number, found in zip((20, 200), beside, strict=True):
                print(f"  beside {number} slow connections: {found:.1f} ms (at most {limit:.1f})")
            before, begun_at = resident_kb(server.process.pid), time.monotonic()
            head = POST + f"Content-Length: {MANY_BYTES}\r\n\r\n".encode()
            num_sent, answer = pour(server.port, head)
            took_s = time.monotonic() - begun_at
            growth_kb = resident_kb(server.process.pid) - before
            print(f"100 MB: refused with {answer[9:12] or 'a reset'} after {num_sent / 1e6:.1f} MB and {took_s:.2f} s")
            print(f"  memory: {growth_kb / 1024:+.1f} MB (at most {MOST_GROWTH_KB / 1024:.0f})")
    is_well = max(beside) <= limit and took_s <= LONGEST_REFUSAL_S and growth_kb <= MOST_GROWTH_KB
    return 0 if is_well else 1


def p95_ms(port: int) -> float:
    """Load the welcome page again and again; return the 95th percentile of the times."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    times = []
    for _ in range(NUM_REQUESTS):
        begun_at = time.perf_counter()
        connection.request("GET", "/")
        connection.getresponse().read()
        times.append(1000 * (time.perf_counter() - begun_at))
    connection.close()
    return statistics.quantiles(times, n=20)[-1]


def _round(port: int) -> tuple[float, float, float]:
    """Measure alone, beside 20 and beside 200 connections that have sent half of something."""
    alone = p95_ms(port)
    beside = []
    for number in (20, 200):
        with ExitStack() as stack:
            for _ in range(number):
                slow = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10))
                slow.sendall(b"POST /consent HTTP/1.1\r\nHost: ")
            beside.append(p95_ms(port))
    return alone, beside[0], beside[1]


if __name__ == "__main__":
    sys.exit(main())
