"""A client with pymoos' names: it lives on a thread of its own, and is spoken to from any."""

from __future__ import annotations

import atexit
import os
import re
import sys
import threading
import weakref
from typing import TYPE_CHECKING, Any, Callable, List, NoReturn, Optional, Set, Tuple

from ._client import Client
from ._elk import Error, Message, Rejection, Runner, interrupt, let_go_of_parent
from ._queues import ActiveQueues, Waiting
from ._words import named, said, shown

#: What pymoos' `comms` has and this one has not: why, and what is right.
NOT_HERE = {
    "do_local_time_correction": "client and broker are on one machine and have one clock; leave the call out",
    "set_comms_tick": "nothing ticks: a client sleeps until something is said; leave the call out",
    "get_comms_control_timewarp_scale_factor": "nothing is gathered at high time warps; leave the call out",
    "set_comms_control_timewarp_scale_factor": "nothing is gathered at high time warps; leave the call out",
    "enable_comms_status_monitoring": "the broker always knows how its clients are; `elk info CLIENT` and `elk apps` show it",
    "get_client_comms_status": "the broker knows how its clients are; `elk info CLIENT` shows it",
    "get_client_comms_statuses": "the broker knows how its clients are; `elk apps` and `elk top` show it",
}

#: The longest that `wait_until_connected` waits (ms).
LONGEST_WAIT_MS = 1e9

_running: "weakref.WeakSet[comms]" = weakref.WeakSet()


#: A client whose callback does not end is waited for so long (s) when it is closed, and so long is each of its queues.
PATIENCE, QUEUE_PATIENCE = 15.0, 5.0


@atexit.register
def _close_all() -> None:
    # A thread that comes back to an interpreter that is gone ends its process.
    left = [thread for one in list(_running) for thread in one._leave(nice=False)]
    for thread in left:
        # One that waits in the kernel does not come back; one that computes does, and comes to its end here.
        interrupt(thread.ident or 0, _Ended)
    for thread in left:
        thread.join(1)
        if thread.is_alive():
            print(f"{thread.name}: a callback does not end; it is left behind", file=sys.stderr, flush=True)
    if any(thread.is_alive() and thread.ident in _Ended.heard for thread in left):
        # It will not hear of the interpreter's end either.
        print("a callback goes on although it was asked to end; the process ends without it", file=sys.stderr, flush=True)
        sys.stdout.flush()
        os._exit(1)


class _Ended(SystemExit):
    """Raised in the midst of a callback that is still there at the interpreter's end."""

    #: The threads that have been told.
    heard: Set[int] = set()

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.heard.add(threading.get_ident())


def _forget_all() -> None:
    # A fork has none of the threads, and nothing to close; and what they had locked stays locked there.
    let_go_of_parent()
    for one in list(_running):
        one._forget()
    _running.clear()


os.register_at_fork(after_in_child=_forget_all)


class comms(Client):
    """pymoos' `comms`, over shared memory.

    What a callback raises ends the client: its traceback is printed with the client's name, and whoever uses the client
    afterwards is told. What pymoos answers with False, or passes over with a warning, is an error with what would be right."""

    _runner: Runner

    def __init__(self) -> None:
        self._thread: Optional[threading.Thread] = None
        self._community, self._name, self._process = "", "", 0
        self._forget()
        self._on_connect: Optional[Callable[[], Any]] = None
        self._on_mail: Optional[Callable[[], Any]] = None
        self._connected = threading.Event()
        self._failure: Optional[BaseException] = None
        self._registered: Set[Tuple[str, str]] = set()
        self._published: Set[str] = set()
        self._is_quiet, self._is_verbose = True, False

    def _forget(self) -> None:
        self._waiting = Waiting()
        self._queues = ActiveQueues(self._queue_failed, self._queue_rejected)

    if not TYPE_CHECKING:  # to a type checker it has what it has

        def __getattr__(self, name: str) -> NoReturn:
            why = f": {NOT_HERE[name]}" if name in NOT_HERE else ""
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{why}")

    # What is said to pymoos before `run`.

    def set_on_connect_callback(self, func: Callable[[], Any]) -> bool:
        """Has `func()` called, on the client's thread, when it has joined: register there. After a broker's death the client
        joins the next one with all its registrations by itself."""
        self._on_connect = _callable("set_on_connect_callback", func)
        return True

    def set_on_mail_callback(self, func: Callable[[], Any]) -> bool:
        """Has `func()` called, on the client's thread, when there is something to `fetch`."""
        self._on_mail = _callable("set_on_mail_callback", func)
        return True

    def add_active_queue(self, queue_name: str, func: Callable[[Message], Any]) -> bool:
        """A queue with a thread of its own, which calls `func(message)` for each message that is routed to it."""
        self._queues.add(queue_name, func)
        return True

    def remove_active_queue(self, queue_name: str) -> bool:
        """Ends a queue, once what it has is handled; its messages are for `fetch` again. Whether there was one."""
        return self._queues.remove(queue_name)

    def has_active_queue(self, queue_name: str) -> bool:
        """Whether there is such a queue."""
        return self._queues.has(queue_name)

    def add_message_route_to_active_queue(self, queue_name: str, msg_name: str) -> bool:
        """Messages of a variable go to this queue, and to the others that it is routed to, and not to `fetch`."""
        self._queues.route(queue_name, msg_name)
        return True

    def remove_message_route_to_active_queue(self, queue_name: str, msg_name: str) -> bool:
        """Messages of a variable go to this queue no longer: once to no queue, for `fetch` again. Whether they went there."""
        return self._queues.unroute(queue_name, msg_name)

    def print_message_to_active_queue_routing(self) -> None:
        """Prints which variables go to which active queues, one a line."""
        for variable, names in self._queues.routes().items():
            print(f"{variable} -> {', '.join(names)}")

    def set_quiet(self, quiet: bool) -> None:
        """With False, standard error says when the client looks for its broker, joins and leaves. (In pymoos it does unless it is
        told to be quiet, here it does not.)"""
        self._is_quiet = quiet

    def set_verbose_debug(self, verbose: bool) -> None:
        """With True, standard error says all that the client says and hears."""
        self._is_verbose = verbose

    # The client's life.

    def run(self, community: str, name: str, *_unused: Any) -> bool:
        """Joins a community under a name, and waits for its broker in the background if it is not there yet. (pymoos: host,
        port, name.)"""
        if self._thread is not None:
            raise Error(f"{named(name)} is running already; right is a new comms()")
        if not isinstance(name, str) or not isinstance(community, str):
            raise Error(f"run({shown(community)}, {shown(name)}, …): right is run(community, name), as run('elk', 'my_client')")
        self._runner = Runner(name, community)
        self._community, self._name, self._process = community, name, os.getpid()
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

    def is_asynchronous(self) -> bool:
        """Whether mail comes as soon as it is there: always."""
        return True

    def wait_until_connected(self, n_ms: int) -> bool:
        """Waits at most so long (ms) until it has joined and its on-connect callback is through; whether it has."""
        if self._thread is None:
            raise Error("nothing is running; right is run(community, name) before")
        if not isinstance(n_ms, (int, float)) or not 0 <= n_ms <= LONGEST_WAIT_MS:
            raise Error(f"wait_until_connected({shown(n_ms)}): right is a time from 0 to {LONGEST_WAIT_MS:.0f} ms")
        self._connected.wait(n_ms / 1000)
        self._check()
        return self.is_connected()

    def close(self, nice: bool = True) -> bool:
        """Leaves, and waits until the client's threads have ended; with `nice` for its queues' messages, too. Whether they have:
        a callback that does not end is waited for for some seconds. A callback that closes its own client does not wait for
        itself: the client leaves when it has returned."""
        if self._thread is None:
            return False
        return not self._leave(nice)

    def _leave(self, nice: bool) -> List[threading.Thread]:
        """Leaves; the threads that have not ended, though they were waited for."""
        if self._thread is None or self._process != os.getpid():
            return []
        self._runner.stop()
        left = []
        if self._thread is not threading.current_thread():
            self._thread.join(PATIENCE)
            left = [self._thread] if self._thread.is_alive() else []
        return left + self._queues.close(nice, QUEUE_PATIENCE)

    # What it has heard, and says.

    def fetch(self) -> List[Message]:
        """The messages that have come since the last call."""
        messages = self._waiting.take()
        if not messages:
            self._check()
        return messages

    def lost(self) -> int:
        """Messages that were given up because nobody fetched them."""
        return self._waiting.lost + self._queues.lost()

    def unregister(self, name: str, app_pattern: str = "*") -> bool:
        """Takes a registration back: the one with these words."""
        self._check()
        super().unregister(name, app_pattern)
        self._registered.discard((name, app_pattern))
        return True

    def _register(self, variables: str, sources: str, rate: Optional[float], lossless: bool) -> None:
        self._check()
        super()._register(variables, sources, rate, lossless)
        self._registered.add((variables, sources))
        if self._is_verbose:
            self._report(f"registers for {named(variables)} of {named(sources)}")

    def _publish(self, name: str, value: Any, time: Optional[float], type: Optional[str], aux_src: str) -> None:
        if self._thread is None:
            self._check()
        super()._publish(name, value, time, type, aux_src)
        self._published.add(name)
        if self._is_verbose:
            self._report(f"says {named(name)}={shown(value)}")

    # What pymoos tells of itself.

    def is_registered_for(self, name: str) -> bool:
        """Whether it hears this variable, of whichever app: by its name or by a pattern."""
        return any(_fits(pattern, name) for pattern, _ in list(self._registered))

    def get_registered(self) -> Set[str]:
        """The names and patterns that it has registered for."""
        return {variables for variables, _ in list(self._registered)}

    def get_published(self) -> Set[str]:
        """The variables that it has said something of."""
        return set(self._published)

    def get_community_name(self) -> str:
        """The community that it has joined; empty: none."""
        return self._community if self.is_connected() else ""

    def get_moos_name(self) -> str:
        """The name that the broker knows it by; empty before `run`."""
        return self._name

    def get_description(self) -> str:
        """Who it is, and where."""
        return f"{self._name} in community {self._community}, over shared memory" if self._name else "not running"

    def get_number_of_unread_messages(self) -> int:
        """Messages that wait for `fetch`."""
        return self._waiting.messages.qsize()

    def get_number_of_unsent_messages(self) -> int:
        """Messages that wait for the client's thread to be said."""
        return self._counts()[4]

    def get_number_message_read(self) -> int:
        """Messages that have come so far."""
        return self._counts()[0]

    def get_number_bytes_read(self) -> int:
        """Bytes of the values that have come so far: 8 of a number, UTF-8 of a text."""
        return self._counts()[1]

    def get_number_messages_sent(self) -> int:
        """Messages that it has said so far."""
        return self._counts()[2]

    def get_number_bytes_sent(self) -> int:
        """Bytes of the values that it has said so far: 8 of a number, UTF-8 of a text."""
        return self._counts()[3]

    def _counts(self) -> Tuple[int, int, int, int, int]:
        return (0, 0, 0, 0, 0) if self._thread is None else self._runner.counts()

    # How it lives.

    def _check(self) -> None:
        if self._thread is None:
            raise Error("nothing is running; right is run(community, name) before")
        if self._process != os.getpid():
            raise Error(f"{self._name} is a client of process {self._process}, and this is a fork of it; right is one of its own")
        if self._failure is not None:
            raise Error(f"{self._thread.name} has ended: {_words(self._failure)}") from self._failure

    def _live(self) -> None:
        if not self._is_quiet:
            self._report(f"looks for the broker of {self._community}")
        try:
            self._runner.run(self, waits=True)
        except BaseException as failure:
            self._failure = failure
            raise
        finally:
            self._connected.set()

    def _queue_failed(self, name: str, failure: BaseException) -> None:
        self._failure = Error(f"active queue {name} raised {type(failure).__name__}: {said(failure)}")
        self._failure.__cause__ = failure
        if self._thread is not None:
            self._runner.stop()

    def _queue_rejected(self, message: Message, why: Rejection) -> None:
        self._runner.reject(message, said(why))

    def _report(self, words: str) -> None:
        print(f"{self._name} {words}", file=sys.stderr)

    # What the framework calls.

    def on_start_up(self) -> None:
        if not self._is_quiet:
            self._report(f"has joined {self._community}")
        if self._on_connect is not None:
            self._on_connect()
        self._connected.set()

    def on_new_mail(self, message: Message) -> None:
        if self._is_verbose:
            self._report(f"hears {message!r}")
        if self._queues.put(message):
            return
        self._waiting.put(message)
        if self._on_mail is not None:
            self._on_mail()

    def on_stop(self) -> None:
        if not self._is_quiet:
            self._report(f"leaves {self._community}")

    def on_refused(self, variable: str, reason: str) -> None:
        pass


def _callable(of: str, func: Any) -> Any:
    if func is not None and not callable(func):
        raise Error(f"{of}({shown(func)}): right is a function without arguments, or None")
    return func


def _words(failure: BaseException) -> str:
    """What ended a client: of an exit, which is no failure elsewhere, that it was one."""
    words = said(failure)
    return words if isinstance(failure, Error) else f"a callback raised {type(failure).__name__}({words})"


def _fits(pattern: str, name: str) -> bool:
    """Whether a name is one of a pattern of the bus: `*` is any characters, `?` one."""
    words = re.escape(pattern).replace(r"\*", ".*").replace(r"\?", ".")
    return re.fullmatch(words, name, re.DOTALL) is not None
