"""Fifty people agree at once, over real connections to the real server."""

import http.client
import re
import threading
from collections import Counter
from pathlib import Path
from urllib.parse import urlencode

from tests.web.people import SAME_SITE
from tests.web.reading import ask
from tests.web.servers import serving

NUM_ARRIVALS = 50


def test_fifty_simultaneous_consents_use_every_arrangement_equally_often(instance: Path) -> None:
    barrier, answers = threading.Barrier(NUM_ARRIVALS), Counter[tuple[int, str | None]]()

    def arrive(port: int) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request("GET", "/")
        nonce = re.search(r'name="nonce" value="([0-9a-f]{32})"', connection.getresponse().read().decode())
        assert nonce is not None
        barrier.wait(timeout=60)
        form = urlencode({"agree": "yes", "nonce": nonce[1]})
        connection.request("POST", "/consent", form, {"Content-Type": "application/x-www-form-urlencoded", **SAME_SITE})
        answer = connection.getresponse()
        answers[answer.status, answer.getheader("Location")] += 1
        connection.close()

    with serving(instance) as server:
        threads = [threading.Thread(target=arrive, args=(server.port,)) for _ in range(NUM_ARRIVALS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert answers == {(303, "/study/1"): NUM_ARRIVALS}
    for experiment, num_arrangements in (("1", 6), ("2", 2)):
        used = Counter(ask(instance, "SELECT arrangement FROM arrangements WHERE experiment = ?", experiment))
        assert set(used) == {(arrangement,) for arrangement in range(num_arrangements)}
        assert used.total() == NUM_ARRIVALS
        assert max(used.values()) - min(used.values()) <= 1
    cells = ask(instance, "SELECT DISTINCT layout, kind FROM trials WHERE experiment = '1'")
    assert len(cells) == 9
