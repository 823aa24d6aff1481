"""Messages that wait, and queues with threads of their own that call somebody for each."""

from __future__ import annotations

import queue
import threading
from typing import Any, Callable, Dict, List, Optional, Tuple

from ._elk import Error, Message, Rejection
from ._words import named, shown

#: Messages that wait for `fetch`, or for an active queue, at most, and bytes of them, but for the last one; then the oldest are
#: lost, and counted.
MOST_WAITING = 100_000
MOST_BYTES = 256 << 20


class Waiting:
    """Messages that wait, the oldest given up when there are too many, or when they are too long."""

    def __init__(self) -> None:
        self.messages: "queue.Queue[Optional[Message]]" = queue.Queue()
        self.lost = 0
        self._bytes = 0
        self._counting = threading.Lock()

    def put(self, message: Message) -> None:
        size = self._count(message, 1)
        while self.messages.qsize() >= MOST_WAITING or self._bytes > max(MOST_BYTES, size):
            if self.next() is None:
                break
            self.lost += 1
        self.messages.put(message)

    def next(self) -> Optional[Message]:
        """The oldest message; None: nothing waits."""
        try:
            message = self.messages.get_nowait()
        except queue.Empty:
            return None
        return self._taken(message)

    def wait(self) -> Optional[Message]:
        """The oldest message, as soon as there is one; None: no more will come."""
        return self._taken(self.messages.get())

    def end(self) -> None:
        """No more will come."""
        self.messages.put(None)

    def _taken(self, message: Optional[Message]) -> Optional[Message]:
        if message is not None:
            self._count(message, -1)
        return message

    def _count(self, message: Message, sign: int) -> int:
        size = message.__sizeof__()
        with self._counting:
            self._bytes += sign * size
        return size

    def take(self) -> List[Message]:
        return list(iter(self.next, None))


class ActiveQueues:
    """Active queues by name, and the variables whose messages go to them. `failed` is told what a callback has raised,
    and `rejected` of which message it could make nothing."""

    def __init__(self, failed: Callable[[str, BaseException], Any], rejected: Callable[[Message, Rejection], Any]) -> None:
        self._failed, self._rejected = failed, rejected
        self._queues: Dict[str, Waiting] = {}
        # Only to queues that are there.
        self._routes: Dict[str, Tuple[str, ...]] = {}
        self._changing = threading.Lock()
        self._workers: List[threading.Thread] = []

    def add(self, name: str, callback: Callable[[Message], Any]) -> None:
        if not isinstance(name, str) or not callable(callback):
            raise Error(f"an active queue {shown(name)} that calls {shown(callback)}: right is a text, and a function of a message")
        with self._changing:
            if name in self._queues:
                raise Error(f"there is an active queue {named(name)} already; right is another name")
            waiting = self._queues[name] = Waiting()
        worker = threading.Thread(target=self._serve, args=(name, waiting, callback), name=name, daemon=True)
        worker.start()
        # Those of queues that were removed are of no interest.
        self._workers = [one for one in self._workers if one.is_alive()] + [worker]

    def remove(self, name: str) -> bool:
        with self._changing:
            waiting = self._queues.pop(name, None)
            if waiting is None:
                return False
            for variable in list(self._routes):
                self._unroute(name, variable)
            waiting.end()
        return True

    def has(self, name: str) -> bool:
        return name in self._queues

    def route(self, name: str, variable: str) -> None:
        with self._changing:
            if name not in self._queues:
                raise Error(f"there is no active queue {named(name)}; add_active_queue makes one")
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

    def close(self, nice: bool, patience: float) -> List[threading.Thread]:
        """Ends all queues, with `nice` once what they have is handled, and waits at most `patience` (s) for each; those that have
        not ended then."""
        for name, waiting in list(self._queues.items()):
            if not nice:
                waiting.take()
            self.remove(name)
        others = [worker for worker in self._workers if worker is not threading.current_thread()]
        for worker in others:
            worker.join(patience)
        return [worker for worker in others if worker.is_alive()]

    def _serve(self, name: str, waiting: Waiting, callback: Callable[[Message], Any]) -> None:
        while (message := waiting.wait()) is not None:
            try:
                callback(message)
            except Rejection as why:
                self._rejected(message, why)
            except BaseException as failure:
                self._failed(name, failure)
                raise
