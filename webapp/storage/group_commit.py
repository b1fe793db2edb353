"""One flush of the disk for everybody who writes at the same time.

A commit waits for the disk, and that is most of what storing an answer takes. Threads that wait for their turn to write
therefore join the transaction that is open: each has a turn alone, within a savepoint of its own, and hands over; the
last of them commits for all, and nobody goes on before that. Nobody waits for company either: where no one else is
waiting, a transaction is committed at once, as if there were no groups.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError, OperationalError, SQLAlchemyError

from webapp.storage.baton import Baton

MAX_MEMBERS = 32
"""How many turns share a commit at most, so that the first of them does not wait for a crowd."""

# In words of SQL: SQLAlchemy puts its own savepoints together anew each time, which takes longer than setting them.
# Each hides those of the same name before it, which need not be released: the commit does that.
_SET, _GO_BACK = "SAVEPOINT turn", "ROLLBACK TO SAVEPOINT turn"
_KEPT = "kept"


def kept(connection: Connection) -> dict[str, Any]:
    """Return what the turns of the open transaction keep for those after them; a turn that is undone empties it."""
    current = connection.get_transaction()
    transaction, found = connection.info.get(_KEPT, (None, None))
    if found is None or transaction is not current:
        connection.info[_KEPT] = current, (found := {})
    kept_so_far: dict[str, Any] = found
    return kept_so_far


class _Signal:
    """Something that is given once, and waited for by any number of threads: a `threading.Event` of one lock.

    An event has three, which wakes threads that cannot go on yet.

    Attributes:
        is_given: Whether it was.
    """

    __slots__ = ("_gate", "is_given")

    def __init__(self) -> None:
        self.is_given = False
        self._gate = threading.Lock()
        self._gate.acquire()

    def give(self) -> None:
        """Let all who wait go on."""
        self.is_given = True
        self._gate.release()

    def wait(self) -> None:
        """Return when it was given."""
        with self._gate:
            pass


class GroupCommit:
    """The turns of a process's threads at its one writing connection.

    Attributes:
        num_commits: How many transactions were committed or undone so far, of however many turns each.
    """

    def __init__(
        self,
        begin: Callable[[], AbstractContextManager[Connection]],
        max_members: int = MAX_MEMBERS,
        baton: Baton | None = None,
        before_undoing: Callable[[Connection], None] = lambda _: None,
    ) -> None:
        """Take turns.

        Args:
            begin: Opens the writing transaction; leaving its context commits, or undoes it where it is left with an
                exception. It may be left by another thread than it was entered by. Only one is open at a time.
            max_members: How many turns share a commit at most.
            baton: What threads that wait lay aside.
            before_undoing: Called before a turn is undone.
        """
        self.num_commits = 0
        self._begin = begin
        self._max_members = max_members
        self._baton = baton or Baton()
        self._before_undoing = before_undoing
        self._lock = threading.Lock()
        self._is_taken = False
        self._waiting: deque[_Signal] = deque()
        # The open transaction. It belongs to whoever has the turn.
        self._group: _Group | None = None

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Take a turn: no other runs meanwhile, and each sees what those before it did.

        What was done is on disk when the context ends, or is undone if it ends with an exception, which undoes nothing
        of the others. An exception, too, is told only when that is on disk on which the body may have based it.

        Raises:
            sqlalchemy.exc.OperationalError: Nothing of the whole group could be stored; another try may help.
        """
        self._take_turn()
        try:
            group = self._join()
            with group.part():
                yield group.connection
        except Exception as error:
            joined = self._group
            self._end_turn()
            if joined is not None and joined.broken_by is not error:
                joined.wait(error)
            raise
        except BaseException:
            self._end_turn()
            raise
        self._end_turn()
        group.wait()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Take a turn outside every transaction, with everything before it committed: for what takes longer."""
        self._take_turn()
        try:
            self._finish()
            yield
        finally:
            self._end_turn()

    def _take_turn(self) -> None:
        turn = _Signal()
        try:
            with self._lock:
                if self._is_taken:
                    self._waiting.append(turn)
                else:
                    turn.give()
                    self._is_taken = True
            if not turn.is_given:
                with self._baton.aside():
                    turn.wait()
        except BaseException:  # Such as Ctrl-C. If the turn was given meanwhile, somebody has to commit.
            with self._lock:
                if turn in self._waiting:
                    self._waiting.remove(turn)
            if turn.is_given:
                self._end_turn()
            raise

    def _end_turn(self) -> None:
        """Hand the open transaction to whoever waits, or commit it."""
        group = self._group
        may_grow = group is not None and group.broken_by is None and group.num_members < self._max_members
        if may_grow and self._pass_on():
            return
        with self._baton.aside():
            try:
                self._finish()
            finally:
                self._pass_on(or_free=True)

    def _pass_on(self, *, or_free: bool = False) -> bool:
        """Give the turn to whoever waits longest, and tell whether there was anybody."""
        with self._lock:
            if self._waiting:
                self._waiting.popleft().give()
                return True
            self._is_taken = not or_free
            return False

    def _join(self) -> "_Group":
        if self._group is None:
            with self._baton.aside():
                self._group = _Group(self._begin(), self._baton, self._before_undoing)
        self._group.num_members += 1
        return self._group

    def _finish(self) -> None:
        group, self._group = self._group, None
        if group is not None:
            self.num_commits += 1
            group.finish()


class _Group:
    """A transaction that several turns share.

    Attributes:
        connection: The connection that it is open on.
        num_members: How many have had a turn, the current one included.
        broken_by: Why nothing of it can be kept; None while it can.
    """

    def __init__(
        self,
        transaction: AbstractContextManager[Connection],
        baton: Baton,
        before_undoing: Callable[[Connection], None],
    ) -> None:
        self.connection = transaction.__enter__()
        self.num_members = 0
        self.broken_by: BaseException | None = None
        self._transaction = transaction
        self._baton = baton
        self._before_undoing = before_undoing
        self._finished = _Signal()

    @contextmanager
    def part(self) -> Iterator[None]:
        """Undo what one member does if it fails; the first is alone in the transaction and needs no savepoint."""
        has_savepoint = False
        try:
            if self.num_members > 1:
                self.connection.exec_driver_sql(_SET)
                has_savepoint = True
            yield
        except BaseException as error:
            if not has_savepoint or not self._undo():
                self.broken_by = error
            raise

    def _undo(self) -> bool:
        """Go back to the savepoint; some errors, such as a lost connection, have ended the whole transaction."""
        try:
            self._before_undoing(self.connection)
            self.connection.info.pop(_KEPT, None)
            self.connection.exec_driver_sql(_GO_BACK)
        except SQLAlchemyError:
            return False
        return not self.connection.invalidated

    def finish(self) -> None:
        """Commit, or undo what is broken, and let all members know."""
        try:
            if self.broken_by is None:
                self._transaction.__exit__(None, None, None)
            else:
                with suppress(SQLAlchemyError):  # What broke it is told instead.
                    self._transaction.__exit__(type(self.broken_by), self.broken_by, self.broken_by.__traceback__)
        except SQLAlchemyError as error:
            self.broken_by = error
        except BaseException as error:
            self.broken_by = error
            raise
        finally:
            self._finished.give()

    def wait(self, error: Exception | None = None) -> None:
        """Return when everything is on disk, or raise, from an error that would be raised otherwise."""
        if not self._finished.is_given:
            with self._baton.aside():
                self._finished.wait()
        if self.broken_by is not None:
            raise _failure(self.broken_by) from error or self.broken_by


def _failure(cause: BaseException) -> OperationalError:
    """Return an error of one's own, since several threads raise it."""
    told = cause.orig if isinstance(cause, DBAPIError) and cause.orig is not None else cause
    return OperationalError("COMMIT", None, told)
