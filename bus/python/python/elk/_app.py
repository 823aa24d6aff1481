"""An app: three callbacks, as in MOOS."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType
from typing import Dict, List, Optional

from ._client import Client
from ._lines import Lines, is_run_by_lines
from ._elk import Message, Runner, launched


class App(Client):
    """An app: a subclass says what it does when it starts, with each message, and at its tick.

    Name, community and parameters are what a launcher has handed over (`elk launch`, `elk swap`), or a person at a terminal
    (`python my_app.py Rate=4`), unless they are said here. Without both, the name is the program's and the community `elk`.

    It is a client on shared memory where a mission says `exec="./my_app.py"`, and is heard in lines where it says `pipe="./my_app.py"`,
    as a suite does (`elk.evaluate`)."""

    #: Time between two calls of `iterate` (s, the community's clock); None: it is never called.
    period: Optional[float] = None

    def __init__(self, name: Optional[str] = None, community: Optional[str] = None) -> None:
        lines = Lines() if is_run_by_lines() else None
        told_name, told_community, parameters, arguments = lines.launched() if lines else launched(sys.argv)
        #: The name that the broker knows it by.
        self.name: str = name or told_name
        #: The community that it joins.
        self.community: str = community or told_community
        #: Its parameters, as the mission says them: name and text.
        self.parameters: Dict[str, str] = dict(parameters)
        #: Its other arguments.
        self.arguments: List[str] = arguments
        self._runner = lines or Runner(self.name, self.community)

    def parameter(self, name: str, default: str) -> str:
        """A parameter's text, or `default` if nothing was said of it. As in MOOS, case does not count."""
        return next((text for one, text in self.parameters.items() if one.lower() == name.lower()), default)

    def on_start_up(self) -> None:
        """Called once, when the broker has let the app in: register here."""

    def on_new_mail(self, message: Message) -> None:
        """Called with each message, in the broker's order. An app that raises `elk.Rejection` cannot use this message, and is
        given the next one; any other exception ends it."""

    def iterate(self) -> None:
        """Called every `period`."""

    def on_stop(self) -> None:
        """Called on the way out, while the bus is still there."""

    def on_refused(self, variable: str, reason: str) -> None:
        """Called when the broker has refused a message or a registration; that is said and counted already."""

    def time(self) -> float:
        """The community's time (s), in a callback."""
        time = self._runner.time()
        if time is None:
            raise RuntimeError(f"{self.name}: the community's time is known in a callback")
        return time

    def dropped(self) -> int:
        """Messages that were lost because they were not read in time, in a callback."""
        return self._runner.dropped() or 0

    def stop(self) -> None:
        """Asks `run` to end after the present callback."""
        self._runner.stop()

    def run(self) -> None:
        """Runs the app until it stops itself, fails, its successor is ready, or a signal asks it to: SIGTERM, or Ctrl-C,
        which is a KeyboardInterrupt once the app has left; the second one comes in the midst of a callback.

        Raises elk.Error: there is no broker, or a callback has raised something, which is its cause."""
        if threading.current_thread() is not threading.main_thread():
            return self._runner.run(self, self.period)
        asked: List[int] = []

        def ask(number: int, frame: Optional[FrameType]) -> None:
            if number in asked and number == signal.SIGINT:
                raise KeyboardInterrupt
            asked.append(number)
            self.stop()

        signals = [one for one in (signal.SIGTERM, signal.SIGINT) if signal.getsignal(one) != signal.SIG_IGN]
        before = [signal.signal(one, ask) for one in signals]
        wakes = signal.set_wakeup_fd(self._runner.signal_fd(), warn_on_full_buffer=False)
        try:
            self._runner.run(self, self.period)
        finally:
            signal.set_wakeup_fd(wakes)
            for one, handler in zip(signals, before):
                signal.signal(one, handler)
        if signal.SIGINT in asked:
            raise KeyboardInterrupt
