"""Messages that wait, and queues with threads of their own that call somebody for each."""

from __future__ import annotations

import queue
import threading
from typing import Any, Callable, Dict, List, Optional, Tuple

from ._elk import Error, Message

#: Messages that wait for `fetch`, or for an active queue, at most; then the oldest are lost, and counted.
MOST_WAITING = 100_000


class Waiting:
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


class ActiveQueues:
    """Active queues by name, and the variables whose messages go to them. `failed` is told what a callback has raised."""

    def __init__(self, failed: Callable[[str, BaseException], Any]) -> None:
        self._failed = failed
        self._queues: Dict[str, Waiting] = {}
        # Only to queues that are there.
        self._routes: Dict[str, Tuple[str, ...]] = {}
        self._changing = threading.Lock()
        self._workers: List[threading.Thread] = []

    def add(self, name: str, callback: Callable[[Message], Any]) -> None:
        with self._changing:
            if name in self._queues:
                raise Error(f"there is an active queue {name} already; right is another name")
            waiting = self._queues[name] = Waiting()
        worker = threading.Thread(target=self._serve, args=(name, waiting, callback), name=name, daemon=True)
        self._workers.append(worker)
        worker.start()

    def remove(self, name: str) -> bool:
        with self._changing:
            waiting = self._queues.pop(name, None)
            if waiting is None:
                return False
            for variable in list(self._routes):
                self._unroute(name, variable)
            waiting.messages.put(None)
        return True

    def has(self, name: str) -> bool:
        return name in self._queues

    def route(self, name: str, variable: str) -> None:
        with self._changing:
            if name not in self._queues:
                raise Error(f"there is no active queue {name}; add_active_queue makes one")
            routed = self._routes.get(variable, ())
            if name not in routed:
                self._routes[variable] = (*routed, name)

    def unroute(self, name: str, variable: str) -> bool:
        """Whether there was such a route."""
        with self._changing:
            return self._unroute(name, variable)

    def _unroute(self, name: str, variable: str) -> bool:
        routed = self._routes.get(variable, ())
        rest = tuple(one for one in routed if one != name)
        if rest:
            self._routes[variable] = rest
        else:
            self._routes.pop(variable, None)
        return rest != routed

    def routes(self) -> Dict[str, Tuple[str, ...]]:
        """By variable, the names of the queues that its messages go to."""
        with self._changing:
            return dict(sorted(self._routes.items()))

    def put(self, message: Message) -> bool:
        """Gives a message to all queues that its variable is routed to; whether there is one."""
        if message.key() not in self._routes:
            return False
        with self._changing:
            names = self._routes.get(message.key(), ())
            for name in names:
                self._queues[name].put(message)
        return bool(names)

    def lost(self) -> int:
        return sum(one.lost for one in list(self._queues.values()))

    def close(self, nice: bool, patience: float) -> None:
        """Ends all queues, with `nice` once what they have is handled, and waits at most `patience` (s) for each."""
        for name, waiting in list(self._queues.items()):
            if not nice:
                waiting.take()
            self.remove(name)
        for worker in self._workers:
            if worker is not threading.current_thread():
                worker.join(patience)

    def _serve(self, name: str, waiting: Waiting, callback: Callable[[Message], Any]) -> None:
        while (message := waiting.messages.get()) is not None:
            try:
                callback(message)
            except BaseException as failure:
                self._failed(name, failure)
                raise
