"""A client with pymoos' names: it lives on a thread of its own, and is spoken to from any."""

from __future__ import annotations

import atexit
import queue
import threading
import weakref
from typing import Any, Callable, Dict, List, Optional

from ._client import Client
from ._elk import Error, Message, Runner

#: Messages that wait for `fetch`, or for an active queue, at most; then the oldest are lost, and counted.
MOST_WAITING = 100_000

_running: "weakref.WeakSet[comms]" = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    # A thread that comes back to an interpreter that is gone ends its process.
    for one in list(_running):
        one.close(nice=False)


class _Waiting:
    """Messages that wait, the oldest given up when there are too many."""

    def __init__(self) -> None:
        self.messages: "queue.Queue[Optional[Message]]" = queue.Queue()
        self.lost = 0

    def put(self, message: Message) -> None:
        if self.messages.qsize() >= MOST_WAITING and self.next() is not None:
            self.lost += 1
        self.messages.put(message)

    def next(self) -> Optional[Message]:
        """The oldest message; None: nothing waits."""
        try:
            return self.messages.get_nowait()
        except queue.Empty:
            return None

    def take(self) -> List[Message]:
        return list(iter(self.next, None))


class comms(Client):
    """pymoos' `comms`, over shared memory.

    What a callback raises ends the client: its traceback is printed with the client's name, and whoever uses the client
    afterwards is told."""

    def __init__(self) -> None:
        self._thread: Optional[threading.Thread] = None
        self._waiting = _Waiting()
        self._queues: Dict[str, _Waiting] = {}
        self._routes: Dict[str, str] = {}
        self._workers: List[threading.Thread] = []
        self._on_connect: Optional[Callable[[], Any]] = None
        self._on_mail: Optional[Callable[[], Any]] = None
        self._connected = threading.Event()
        self._failure: Optional[BaseException] = None
        self._early: List[Callable[[Client], Any]] = []

    # What is said to pymoos before `run`.

    def set_on_connect_callback(self, callback: Callable[[], Any]) -> None:
        """Has `callback()` called, on the client's thread, when it has joined: register there. After a broker's death the
        client joins the next one with all its registrations by itself."""
        self._on_connect = callback

    def set_on_mail_callback(self, callback: Callable[[], Any]) -> None:
        """Has `callback()` called, on the client's thread, when there is something to `fetch`."""
        self._on_mail = callback

    def add_active_queue(self, name: str, callback: Callable[[Message], Any]) -> bool:
        """A queue with a thread of its own, which calls `callback(message)` for each message that is routed to it."""
        if name in self._queues:
            raise Error(f"there is an active queue {name} already; right is another name")
        waiting = self._queues[name] = _Waiting()
        worker = threading.Thread(target=self._serve, args=(name, waiting, callback), name=name, daemon=True)
        self._workers.append(worker)
        worker.start()
        return True

    def remove_active_queue(self, name: str) -> bool:
        """Ends a queue, once what it has is handled; its messages are for `fetch` again."""
        waiting = self._queues.pop(name, None)
        if waiting is None:
            return False
        self._routes = {variable: one for variable, one in self._routes.items() if one != name}
        waiting.messages.put(None)
        return True

    def has_active_queue(self, name: str) -> bool:
        """Whether there is such a queue."""
        return name in self._queues

    def add_message_route_to_active_queue(self, name: str, variable: str) -> bool:
        """Messages of a variable go to this queue, and not to `fetch`."""
        if name not in self._queues:
            raise Error(f"there is no active queue {name}; add_active_queue makes one")
        self._routes[variable] = name
        return True

    # The client's life.

    def run(self, community: str, name: str, *_unused: Any) -> bool:
        """Joins a community under a name, and waits for its broker in the background if it is not there yet. (pymoos: host,
        port, name.)"""
        if self._thread is not None:
            raise Error(f"{name} is running already; right is a new comms()")
        if not isinstance(name, str):
            raise Error(f"run({community!r}, {name!r}, …): right is run(community, name), as run('elk', 'my_client')")
        self._runner = Runner(name, community)
        self._thread = threading.Thread(target=self._live, name=name, daemon=True)
        _running.add(self)
        self._thread.start()
        return True

    def is_running(self) -> bool:
        """Whether the client lives."""
        return self._thread is not None and self._thread.is_alive()

    def is_connected(self) -> bool:
        """Whether it has joined."""
        return self._connected.is_set() and self.is_running()

    def wait_until_connected(self, milliseconds: int) -> bool:
        """Waits at most so long until it has joined and its on-connect callback is through; whether it has."""
        if self._thread is None:
            raise Error("nothing is running; right is run(community, name) before")
        self._connected.wait(milliseconds / 1000)
        self._check()
        return self.is_connected()

    def close(self, nice: bool = True) -> bool:
        """Leaves, and waits until the client's threads have ended; with `nice` for its queues' messages, too."""
        thread, self_called = self._thread, threading.current_thread()
        if thread is None:
            return False
        self._runner.stop()
        if thread is not self_called:
            thread.join(15)
        for name in list(self._queues):
            if not nice:
                self._queues[name].take()
            self.remove_active_queue(name)
        for worker in self._workers:
            if worker is not self_called:
                worker.join(5)
        return True

    def fetch(self) -> List[Message]:
        """The messages that have come since the last call."""
        messages = self._waiting.take()
        if not messages:
            self._check()
        return messages

    def lost(self) -> int:
        """Messages that were given up because nobody fetched them."""
        return self._waiting.lost + sum(one.lost for one in list(self._queues.values()))

    def register(self, variables: str, *how: Any, rate: Optional[float] = None, lossless: bool = False) -> bool:
        """Hears these variables. As in pymoos a number that follows is the least time between two messages of one (s), and
        two patterns and a number are variables, sources and that time."""
        sources = next((one for one in how if isinstance(one, str)), "*")
        interval = next((one for one in how if not isinstance(one, str)), 0)
        if interval:
            rate = 1 / interval
        self._check()
        return super().register(variables, sources, rate=rate, lossless=lossless)

    def _check(self) -> None:
        if self._thread is None:
            raise Error("nothing is running; right is run(community, name) before")
        if self._failure is not None:
            raise Error(f"{self._thread.name} has ended: {self._failure}") from self._failure

    def _live(self) -> None:
        try:
            self._runner.run(self, waits=True)
        except BaseException as failure:
            self._failure = failure
            raise
        finally:
            self._connected.set()

    def _serve(self, name: str, waiting: _Waiting, callback: Callable[[Message], Any]) -> None:
        while (message := waiting.messages.get()) is not None:
            try:
                callback(message)
            except BaseException as failure:
                self._failure = Error(f"active queue {name} raised {type(failure).__name__}: {failure}")
                self._failure.__cause__ = failure
                self._runner.stop()
                raise

    # What the framework calls.

    def on_start_up(self) -> None:
        if self._on_connect is not None:
            self._on_connect()
        self._connected.set()

    def on_new_mail(self, message: Message) -> None:
        waiting = self._queues.get(self._routes.get(message.key(), ""))
        if waiting is not None:
            waiting.put(message)
            return
        self._waiting.put(message)
        if self._on_mail is not None:
            self._on_mail()

    def on_stop(self) -> None:
        pass

    def on_refused(self, variable: str, reason: str) -> None:
        pass
