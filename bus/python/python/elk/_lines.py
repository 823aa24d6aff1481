"""An app over lines: what a `Runner` is on shared memory, for a program that `elk pipe` or an evaluation runs."""

from __future__ import annotations

import json
import math
import os
import sys
from collections import deque
from typing import Any, Deque, Dict, List, Optional, Tuple

from ._elk import DecodeError, Error, Rejection
from ._words import said as words_of


#: How deep values lie in each other at most, as elsewhere: a list may lie in itself.
DEEPEST = 64


def is_run_by_lines() -> bool:
    """Whether this program is run by its lines; what it starts itself is not."""
    return os.environ.pop("ELK_LINES", "") == "1"


class Line:
    """A message that came as a line."""

    def __init__(self, said: Dict[str, Any]) -> None:
        self._said = said

    def key(self) -> str:
        return self._said["mail"]

    name = key

    def is_name(self, name: str) -> bool:
        return self.key() == name

    def source(self) -> str:
        return self._said["source"]

    def time(self) -> float:
        return self._said["time"]

    def is_latest(self) -> bool:
        return self._said.get("latest", False)

    def type_name(self) -> str:
        return self._said["type"]

    def is_double(self) -> bool:
        return self.type_name() == "number"

    def is_string(self) -> bool:
        return self.type_name() == "text"

    def is_binary(self) -> bool:
        return not self.is_double() and not self.is_string()

    def double(self) -> float:
        if not self.is_double():
            raise DecodeError(f"{self.key()} carries {self.type_name()}, and no number; right is value(), or to ask is_double() first")
        return float(self._said["value"])

    def string(self) -> str:
        if not self.is_string():
            raise DecodeError(f"{self.key()} carries {self.type_name()}, and no text; right is value(), or to ask is_string() first")
        return self._said["value"]

    def value(self) -> Any:
        return self.double() if self.is_double() else self._said["value"]


class Lines:
    """The client that is on the bus for this program, told what to do in lines."""

    def __init__(self) -> None:
        self._out, sys.stdout = sys.stdout, sys.stderr  # what the app prints is no line
        self._waiting: Deque[Dict[str, Any]] = deque()
        self._stopped, self._lost = False, 0
        self._time: Optional[float] = None
        self.hello: Dict[str, Any] = self._wait_for("hello")["hello"]

    def launched(self) -> Tuple[str, str, List[Tuple[str, str]], List[str]]:
        """Name, community, parameters and other arguments, as a launcher says them."""
        hello = self.hello
        return hello["name"], hello["community"], list(hello["parameters"].items()), sys.argv[1:]

    def run(self, handler: Any, period_secs: Optional[float] = None, waits: bool = False) -> None:
        if period_secs is not None:
            raise Error(f"{self.hello['name']}: iterate is not called over lines; right is a period of None, or exec in place of pipe")
        self._call(handler.on_start_up)
        self._say(ready=True)
        while not self._stopped and (said := self._next()) is not None:
            self._take(handler, said)
        self._call(handler.on_stop)

    def _take(self, handler: Any, said: Dict[str, Any]) -> None:
        if "mail" in said:
            self._time = said["time"]
            try:
                self._call(handler.on_new_mail, Line(said))
            except Rejection as why:
                self._say(log=f"{said['mail']} cannot be used: {words_of(why)}")
        elif "lost" in said:
            self._lost += said["lost"]
        elif "refused" in said:
            self._call(handler.on_refused, said["refused"] or "", said["reason"])

    def _call(self, callback: Any, *arguments: Any) -> None:
        try:
            callback(*arguments)
        except Rejection:
            raise
        except Exception as failure:
            of = f"({arguments[0].key()})" if arguments and isinstance(arguments[0], Line) else ""
            what = f"{callback.__name__}{of} raised {type(failure).__name__}: {words_of(failure)}"
            raise Error(f"{self.hello['name']}: {what}") from failure

    def stop(self) -> None:
        self._stopped = True

    def signal_fd(self) -> int:
        return -1  # a signal comes with the end of what there is to read

    def register(self, variables: str, sources: str = "*", rate: Optional[float] = None, lossless: bool = False) -> None:
        how = {} if rate is None else {"rate": rate}
        self._say(register=variables, **{"from": sources}, lossless=lossless, **how)

    def unregister(self, variables: str, sources: str = "*") -> None:
        self._say(unregister=variables, **{"from": sources})

    def publish(
        self, variable: str, value: Any, time: Optional[float] = None, type_name: Optional[str] = None, source_aux: str = ""
    ) -> None:
        if time is not None or source_aux:
            raise Error(f"{variable}: a line has no place for time and aux_src; right is exec in place of pipe")
        self._say(publish=variable, value=value, **({} if type_name is None else {"type": type_name}))

    def describe(self, variable: str) -> Optional[str]:
        self._say(describe=variable)
        said = self._wait_for("described")
        if said["type"] is None:
            return None
        return json.dumps({name: one for name, one in said.items() if name != "described"})

    def time(self) -> Optional[float]:
        return self._time

    def dropped(self) -> int:
        return self._lost

    def _say(self, **line: Any) -> None:
        try:
            text = json.dumps(line, default=_plain, allow_nan=False)
        except ValueError:  # there are numbers in it that JSON does not have, or it lies in itself
            text = json.dumps(_finite(line, 0), allow_nan=False)
        print(text, file=self._out, flush=True)

    def _next(self) -> Optional[Dict[str, Any]]:
        return self._waiting.popleft() if self._waiting else self._read()

    def _read(self) -> Optional[Dict[str, Any]]:
        line = sys.stdin.readline()
        return json.loads(line) if line else None

    def _wait_for(self, what: str) -> Dict[str, Any]:
        """The next line of a kind; what comes before it waits."""
        while (said := self._read()) is not None:
            if what in said:
                return said
            self._waiting.append(said)
        raise Error(f"the lines have ended before {what!r} came; this is run by `elk pipe`")


def _finite(value: Any, depth: int) -> Any:
    """The same with `"inf"`, `"-inf"` and `"NaN"` for what is no number to JSON, as `elk pipe` takes them."""
    if depth > DEEPEST:
        raise Error(f"values lie more than {DEEPEST} deep in each other")
    if isinstance(value, float):
        return value if math.isfinite(value) else {math.inf: "inf", -math.inf: "-inf"}.get(value, "NaN")
    if isinstance(value, dict):
        return {name: _finite(one, depth + 1) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one, depth + 1) for one in value]
    return _finite(_plain(value), depth + 1) if not isinstance(value, (str, int, type(None))) else value


def _plain(value: Any) -> Any:
    """numpy's values, bytes and the like, as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise Error(f"a {type(value).__name__} is no value that a line can say")
