"""Points to an executor and rows back, whatever becomes of its workers."""

from __future__ import annotations

import atexit
import multiprocessing
import multiprocessing.connection
import os
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from queue import SimpleQueue
from types import FrameType
from typing import Any

from ._errors import SweepWarning, UsageError
from ._sweep_journal import Journal
from ._sweep_task import answer

_PACKAGE = os.path.dirname(os.path.abspath(__file__)) + os.sep


def warn(sentence: str) -> None:
    """A SweepWarning at the line of the caller's that called `sweep`."""
    depth = 1
    frame: FrameType | None = sys._getframe()
    while frame is not None and os.path.abspath(frame.f_code.co_filename).startswith(_PACKAGE):
        depth, frame = depth + 1, frame.f_back
    warnings.warn(sentence, SweepWarning, stacklevel=depth)


Point = tuple[str, dict[str, Any]]  # key and values
_WINDOW = 1000
_FEW = 5  # so many failed points without a result are reported: the cause may be common to all points


class Progress:
    """How far it is, on standard error or to a function."""

    def __init__(self, wish: bool | Callable[[int, int], None], done: int, total: int) -> None:
        self._done, self._total = done, total
        self._tell = wish if callable(wish) else None
        self._bar: Any = None
        self._line = False
        self._told = 0.0
        if wish is True:
            try:
                from tqdm.auto import tqdm

                self._bar = tqdm(total=total, initial=done, unit="point")
            except ModuleNotFoundError:
                self._line = sys.stderr.isatty()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
        if self._line:
            print(f"\r{self._done} of {self._total} points", file=sys.stderr)

    def add(self, count: int) -> None:
        self._done += count
        if self._bar is not None:
            self._bar.update(count)
        if self._tell is not None:
            self._tell(self._done, self._total)
        if self._line and time.monotonic() > self._told + 0.2:
            self._told = time.monotonic()
            print(f"\r{self._done} of {self._total} points", end="", file=sys.stderr, flush=True)


def _end_with_parent(stop: multiprocessing.connection.Connection) -> None:
    """In a worker: ends the process when the parent has ended or has closed its side of `stop`."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    ended, end = multiprocessing.Pipe(duplex=False)

    def watch() -> None:
        if ended not in multiprocessing.connection.wait([parent.sentinel, stop, ended]):
            os._exit(1)

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()

    # A thread that still waits when Python ends would keep this module, and with it models, alive for ever, which
    # nanobind reports.
    @atexit.register
    def leave() -> None:
        end.close()
        watching.join()


class LocalProcesses:
    """Processes of this machine, made again when one of them ends."""

    def __init__(self, tasks: int) -> None:
        self.count = max(1, min(tasks, len(os.sched_getaffinity(0))))
        self._pool: ProcessPoolExecutor | None = None
        self._stop: multiprocessing.connection.Connection | None = None  # closing it ends all workers at once

    def submit(self, *task: Any) -> Future[Any]:
        if self._pool is None:
            # Not forked: a fork has none of the threads that may hold locks at that moment.
            context = multiprocessing.get_context("spawn")
            stop, self._stop = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(
                self.count, mp_context=context, initializer=_end_with_parent, initargs=(stop,)
            )
        return self._pool.submit(*task)

    def close(self, at_once: bool = False) -> None:
        """Ends the workers, which first finish what they compute, unless `at_once`."""
        if self._pool is not None and self._stop is not None:
            if at_once:
                self._stop.close()
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._stop.close()
            self._pool = None

    def check(self) -> None:
        """UsageError where processes cannot even begin."""
        self.close()
        try:
            self.submit(os.getpid).result()
        except BrokenExecutor:
            raise UsageError(
                "worker processes end as soon as they begin: a program that calls fork1s.sweep does so below "
                "`if __name__ == '__main__':`, since every worker reads the program first"
            ) from None


class Sweeping:
    """Asks points; their rows go to the journal in the order in which they come.

    Whose point ended a worker process, Python's pool cannot tell: all that were out with it come back broken. They are
    suspects, and go out again one at a time with nothing beside them; the one that ends its process then is the one.
    An executor of another's fails a task only when something happened to its workers, since a task raises nothing itself;
    whom it names then may have been a bystander (Dask's executor fails a task whose answer came as its worker died). So
    that point is a suspect too, and what it is told of when it is asked alone stands.
    """

    def __init__(
        self,
        task: bytes,
        points: list[Point],
        executor: Executor | None,
        journal: Journal,
        progress: Progress,
        in_flight: int | None,
        chunk: int,
    ) -> None:
        self._task, self._journal, self._progress = task, journal, progress
        self._own: LocalProcesses | None = None
        self._submit: Callable[..., Future[Any]]
        if executor is None:
            self._own = LocalProcesses(len(points))
            self._submit = self._own.submit
        else:
            self._submit = executor.submit
        self._to_ask = deque(points[i : i + chunk] for i in range(0, len(points), chunk))
        self._suspects: deque[list[Point]] = deque()
        self._again: set[str] = set()  # keys of points that an executor has failed once
        self._out: dict[Future[Any], list[Point]] = {}
        self._done: SimpleQueue[Future[Any]] = SimpleQueue()
        self._answered = False
        self._has_failed = False
        self._num_failed = 0
        self._has_result = any(row.get("error") is None for row in journal.rows.values())
        self._window = max(1, (in_flight or (8 * self._own.count if self._own else _WINDOW) * chunk) // chunk)

    def run(self) -> None:
        try:
            while self._to_ask or self._suspects or self._out:
                self._send()
                self._receive()
        finally:
            for future in self._out:
                future.cancel()
            if self._own is not None:
                self._own.close(
                    at_once=bool(self._out)
                )  # some are out where Ctrl-C or an error ends the sweep

    def _send(self) -> None:
        if self._suspects:
            if not self._out:
                self._ask(self._suspects)
            return
        while self._to_ask and len(self._out) < self._window:
            if not self._ask(self._to_ask):
                return

    def _ask(self, queue: deque[list[Point]]) -> bool:
        try:
            # Dask knows a task by its arguments, and would give the failure again without asking anybody.
            attempt = int(queue[0][0][0] in self._again)
            future = self._submit(answer, self._task, queue[0], attempt)
        except BrokenExecutor:
            if self._own is None:
                raise
            if not self._out:
                self._own.close()
            return False
        self._out[future] = queue.popleft()
        future.add_done_callback(self._done.put)
        return True

    def _receive(self) -> None:
        if not self._out:
            return
        alone = len(self._out) == 1 and len(next(iter(self._out.values()))) == 1
        done = [self._done.get()]
        while not self._done.empty():
            done.append(self._done.get())
        if self._own is not None and any(isinstance(f.exception(), BrokenExecutor) for f in done):
            while len(done) < len(self._out):  # the others are broken as well, or were finished before
                done.append(self._done.get())
        broken = []
        for future in done:
            asked = self._out.pop(future)
            try:
                rows = future.result()
            except BrokenExecutor:
                if self._own is None:
                    raise
                broken.append(asked)
            except Exception as problem:
                if len(asked) > 1 or asked[0][0] not in self._again:
                    self._again.update(key for key, _ in asked)
                    self._suspects.extend([point] for point in asked)
                else:
                    self._fail(asked, f"{type(problem).__name__}: {problem}")
            else:
                self._keep(asked, rows)  # an exception of the progress function is not one of the point
        if broken and self._own is not None:
            self._own.close()
            if not self._answered:
                self._own.check()
            if alone:
                self._fail(
                    broken[0], "the process that computed this point ended: killed, or a crash below Python"
                )
            else:
                self._suspects.extend([point] for asked in broken for point in asked)

    def _keep(self, asked: list[Point], rows: list[tuple[str, dict[str, Any]]]) -> None:
        self._answered = True
        points = dict(asked)
        for key, row in rows:
            self._journal.add(key, points[key], row)
        self._journal.flush()  # before code of the caller's runs
        failed = [(points[key], row["error"]) for key, row in rows if row["error"] is not None]
        if failed and not self._has_failed:
            self._has_failed = True
            point, error = failed[0]
            values = ", ".join(f"{name} = {value!r}" for name, value in point.items())
            warn(f"sweep: the point {values} failed: {error}; the other points go on")
        self._has_result = self._has_result or len(failed) < len(rows)
        before, self._num_failed = self._num_failed, self._num_failed + len(failed)
        if (
            not self._has_result
            and before < _FEW <= self._num_failed
            and (self._to_ask or self._suspects or self._out)
        ):
            warn(
                f"sweep: all of the first {self._num_failed} points failed, the last with: {failed[-1][1]}; stop the sweep "
                "(Ctrl-C) if the others would fail too, mend the model, the metric or the parameters and call it again"
            )
        self._progress.add(len(rows))

    def _fail(self, asked: list[Point], sentence: str) -> None:
        row = {"error": sentence, "seconds": None, "worker": None}
        self._keep(asked, [(key, dict(row)) for key, _ in asked])
