"""Waitress's loop, asking only those connections on which something can have changed.

Waitress asks every connection what it waits for, each time that anything happens on one of them. With 200 people at
once that takes longer than their requests do, and holds up the threads that answer them. This loop keeps what is waited
for in a selector (epoll or kqueue). It asks a connection anew after an event on it, while a thread answers on it and
once after that, and all of them once a second, since waitress marks idle connections for closing.

Most requests come when the one before is answered. So the loop goes on listening while a thread answers, and is woken
afterwards only where it has something to do; what comes too early makes it turn away from the connection till then.
"""

import select
import selectors
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from waitress import wasyncore  # type: ignore[import-untyped]
from waitress.channel import HTTPChannel  # type: ignore[import-untyped]
from waitress.task import ErrorTask, Task, WSGITask  # type: ignore[import-untyped]

_ASK_ALL_S = 1.0
# What a thread keeps back until it has answered, so that an answer goes out in one piece.
_SEND_BYTES = 64 * 1024


class Sockets(dict[int, Any]):
    """Waitress's map of everything open, by file descriptor. Only the loop's thread changes it.

    Attributes:
        answering: The connections on which threads answer at the moment.
        answered: Those on which a thread has answered, until the loop asks them.
        thread: The number of the loop's thread.
        served: In its `channel`, by thread, the connection on which the thread answers.
    """

    def __init__(self) -> None:
        super().__init__()
        self.answering: list[Channel] = []
        self.answered: deque[Channel] = deque()
        self._selector = selectors.DefaultSelector()
        self.thread = 0
        self.served = threading.local()
        self._waited_for: dict[int, int] = {}
        self._new: list[int] = []
        self._listening: list[int] = []

    def __setitem__(self, number: int, opened: Any) -> None:  # noqa: ANN401 - waitress has no types.
        """Take in what was opened; it is asked when it is complete."""
        super().__setitem__(number, opened)
        self._new.append(number)

    def __delitem__(self, number: int) -> None:
        """Forget what is about to be closed."""
        super().__delitem__(number)
        if self._waited_for.pop(number, 0):
            self._selector.unregister(number)

    def serve(self) -> None:
        """Let waitress handle what happens, until an exception such as SystemExit ends it.

        Raises:
            OSError: It does not listen any more.
        """
        self.thread = threading.get_ident()
        for opened in self.values():
            if opened.accepting:
                opened.channel_class = Channel
                opened.adj.send_bytes = _SEND_BYTES
                opened.pull_trigger = partial(self._wake, opened.pull_trigger)
        self._listening = [number for number, opened in self.items() if opened.accepting]
        ask_all = 0.0
        while True:
            now = time.monotonic()
            if now >= ask_all:
                ask_all = now + _ASK_ALL_S
                if not all(number in self for number in self._listening):
                    raise OSError("the server does not listen any more")
                self._ask(tuple(self))
            self._turn()

    def _turn(self) -> None:
        """Wait for events, handle them, and ask whatever they can have changed."""
        changed = {*self._listening}
        for key, events in self._selector.select(_ASK_ALL_S):
            # An earlier event may have closed it, and a new connection may have got its number.
            if self.get(key.fd) is key.data:
                readable = select.POLLIN if events & selectors.EVENT_READ and _may_read(key.data) else 0
                writable = select.POLLOUT if events & selectors.EVENT_WRITE else 0
                wasyncore.readwrite(key.data, readable | writable)
                changed.add(key.fd)
        changed.update(self._new)
        self._new.clear()
        # In this order: a thread notes that it has answered before it ceases to be one that answers.
        busy = [*self.answering]
        while self.answered:
            busy.append(self.answered.popleft())
        self._ask(changed)
        self._ask(channel._fileno for channel in busy)

    def _ask(self, numbers: Iterable[int]) -> None:
        for number in numbers:
            opened = self.get(number)
            if opened is not None:
                wanted = selectors.EVENT_READ if _listens(opened) else 0
                if opened.writable() and not opened.accepting:
                    wanted |= selectors.EVENT_WRITE
                self._wait_for(number, wanted, opened)

    def _wake(self, pull: Callable[[], None]) -> None:
        """Wake the loop, unless it is a thread that leaves it nothing to do."""
        channel: Channel | None = getattr(self.served, "channel", None)
        if channel is None or channel.needs_the_loop():
            pull()

    def _wait_for(self, number: int, wanted: int, opened: Any) -> None:  # noqa: ANN401
        before = self._waited_for.get(number, 0)
        if wanted == before:
            return
        if not before:
            self._selector.register(number, wanted, opened)
        elif wanted:
            self._selector.modify(number, wanted, opened)
        else:
            self._selector.unregister(number)
        self._waited_for[number] = wanted


def _may_read(opened: Any) -> bool:  # noqa: ANN401
    """Tell whether what came can be read now; where it cannot, the loop turns away."""
    if not isinstance(opened, Channel) or opened.readable():
        return True
    opened.has_more = True
    return False


def _listens(opened: Any) -> bool:  # noqa: ANN401
    return bool(opened.listens() if isinstance(opened, Channel) else opened.readable())


class _InOnePiece(Task):  # type: ignore[misc]
    """What a thread does for a request: in the end it sends what it kept back, while no other thread may send."""

    def finish(self) -> None:
        """End the answer."""
        super().finish()
        self.channel.send_rest()


class _Answer(_InOnePiece, WSGITask):  # type: ignore[misc]
    """An answer of the app."""


class _Refusal(_InOnePiece, ErrorTask):  # type: ignore[misc]
    """An answer to what is no request."""


class Channel(HTTPChannel):  # type: ignore[misc]
    """A connection that tells the loop while a thread answers on it, and when it has.

    Attributes:
        has_more: Whether something came that cannot be read before a thread has answered.
        is_turned_away_from: Whether the loop does not listen, and has to be woken to do so.
    """

    task_class = _Answer
    error_task_class = _Refusal
    has_more = False
    is_turned_away_from = False

    def service(self) -> None:
        """Answer one request, in a thread."""
        sockets: Sockets = self._map
        sockets.answering.append(self)
        sockets.served.channel = self
        try:
            super().service()
        finally:
            sockets.served.channel = None
            sockets.answered.append(self)
            sockets.answering.remove(self)

    def send_rest(self) -> None:
        """Send, in a thread that answers, as much of what is left as the system takes."""
        if self.total_outbufs_len:
            with self.outbuf_lock:
                self._flush_exception(self._flush_some, do_close=False)

    def needs_the_loop(self) -> bool:
        """Tell whether there is anything that a thread that answers leaves to the loop."""
        is_unfinished = self.total_outbufs_len or self.will_close or self.close_when_flushed
        return bool(self.is_turned_away_from or is_unfinished)

    def listens(self) -> bool:
        """Tell whether the loop should listen; it also does, until something comes, while a thread answers."""
        # In this order: the thread looks whether the loop turned away after it has changed what is asked here.
        self.is_turned_away_from = True
        if self.readable():
            self.has_more = self.is_turned_away_from = False
            return True
        self.is_turned_away_from = self.has_more
        return not self.has_more

    def writable(self) -> bool:
        """Tell whether the loop should send; not while a thread does, which tells the loop if something is left."""
        if self.requests and self.total_outbufs_len < self.adj.send_bytes:
            return False
        if not super().writable() or not self.outbuf_lock.acquire(blocking=False):
            return False
        self.outbuf_lock.release()
        return True

    def handle_close(self) -> None:
        """Close, which is for the loop's thread alone: another, that cannot send, leaves it to the loop."""
        sockets: Sockets = self._map
        if threading.get_ident() == sockets.thread:
            super().handle_close()
        else:
            self.will_close = True
