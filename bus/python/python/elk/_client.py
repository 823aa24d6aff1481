"""What an app and `comms` have in common: a client of the bus, and what it says, in pymoos' words."""

from __future__ import annotations

import json
from typing import Any, Optional, Tuple, Union, overload

from ._elk import Error, Runner
from ._lines import Lines
from ._words import named, shown

#: The time of a message that is of now, as in pymoos.
NOW = -1.0
#: The longest interval of a registration (s), as the bus has them.
LONGEST_INTERVAL = 1e6


class Client:
    """A client of a community: what it says, from any thread."""

    _runner: Union[Runner, Lines]

    @overload
    def register(
        self, name: str, interval: float = ..., *, rate: Optional[float] = ..., lossless: bool = ...
    ) -> bool: ...
    @overload
    def register(
        self,
        var_pattern: str,
        app_pattern: str,
        /,
        interval: float = ...,
        *,
        rate: Optional[float] = ...,
        lossless: bool = ...,
    ) -> bool: ...
    @overload
    def register(
        self,
        *,
        var_pattern: str,
        app_pattern: str = ...,
        interval: float = ...,
        rate: Optional[float] = ...,
        lossless: bool = ...,
    ) -> bool: ...
    def register(
        self,
        name: str = "",
        *how: Any,
        var_pattern: str = "",
        app_pattern: str = "*",
        interval: float = 0.0,
        rate: Optional[float] = None,
        lossless: bool = False,
    ) -> bool:
        """Hears these variables (a name, or a pattern with `*` and `?`) of these apps: the latest value of each, then all new
        ones, those of a variable at least `interval` (s) apart. As in pymoos it is `register(name, interval)` or
        `register(var_pattern, app_pattern, interval)`; besides, `rate` is the messages a second at most, in place of an
        interval, and with `lossless` its publishers wait for it."""
        right = "register(name, interval=0.0) or register(var_pattern, app_pattern, interval=0.0)"
        if not isinstance(name, str) or not isinstance(var_pattern, str) or bool(name) == bool(var_pattern):
            raise Error(f"registered for {shown(name)} and {shown(var_pattern)}: right is {right}")
        variables = name or var_pattern
        if how:
            app_pattern, interval = _of_forms(right, how, (app_pattern, "*"), (interval, 0.0))
        if not isinstance(interval, (int, float, type(None))) or interval:
            rate = _rate(variables, interval, rate)
        self._register(variables, app_pattern, rate, lossless)
        return True

    def unregister(self, name: str, app_pattern: str = "*") -> bool:
        """Takes a registration back: the one with these words."""
        self._runner.unregister(name, app_pattern)
        return True

    @overload
    def notify(
        self, name: str, value: Any, time: Optional[float] = ..., *, aux_src: str = ..., type: Optional[str] = ...
    ) -> bool: ...
    @overload
    def notify(
        self, name: str, value: Any, aux_src: str, time: Optional[float] = ..., *, type: Optional[str] = ...
    ) -> bool: ...
    def notify(
        self,
        name: str,
        value: Any,
        *how: Any,
        time: Optional[float] = NOW,
        aux_src: str = "",
        type: Optional[str] = None,
    ) -> bool:
        """Publishes a value: a number, a text, bytes, or what a typed variable carries, as dicts, lists and numpy arrays. As in
        pymoos it is `notify(name, value, time)` or `notify(name, value, aux_src, time)`: when it was so (s, the community's
        clock; -1: now), and what is said about the source.

        The type is what the variable carries, or what its readers read there; `type` names one of the community's for a
        variable of which nobody has said it."""
        if how:
            right = "notify(name, value, time=-1.0) or notify(name, value, aux_src, time=-1.0)"
            aux_src, time = _of_forms(right, how, (aux_src, ""), (time, NOW))
        is_now = isinstance(time, (int, float)) and time == NOW
        self._publish(name, value, None if is_now else time, type, aux_src)
        return True

    def notify_binary(self, name: str, binary_data: Union[bytes, str], time: Optional[float] = NOW) -> bool:
        """Publishes bytes, as MOOS' clients do; a text's are its UTF-8."""
        return self.notify(name, _bytes(name, binary_data), time)

    def describe(self, variable: str) -> Optional[dict]:
        """What a variable carries: `type`, and of a typed one an `example` value and its `description` (fields, units, docs);
        None if nobody has said."""
        said = self._runner.describe(variable)
        return None if said is None else json.loads(said)

    def _register(self, variables: str, sources: str, rate: Optional[float], lossless: bool) -> None:
        self._runner.register(variables, sources, rate, lossless)

    def _publish(self, name: str, value: Any, time: Optional[float], type: Optional[str], aux_src: str) -> None:
        self._runner.publish(name, value, time, type, aux_src)


def _bytes(name: str, data: Any) -> Any:
    """Bytes, as they are or of a text. No others are made of anything: those of a number would be as many zeros."""
    try:
        return data.encode() if isinstance(data, str) else memoryview(data)
    except (TypeError, ValueError) as why:
        what = f"notify_binary({shown(name)}, …): there are no bytes of this {type(data).__name__}: {why}"
        raise Error(f"{what}; right are bytes, or a text that UTF-8 can say") from why


def _of_forms(right: str, how: Tuple[Any, ...], text: Tuple[str, str], number: Tuple[Any, Any]) -> Tuple[str, Any]:
    """The text and the number of `how`, which is `(text)`, `(number)` or `(text, number)`. `text` and `number` are each what was
    said by a keyword, and what it is if nothing was: it stays if nothing is said by position, and is not said twice."""
    first = how[:1] if isinstance(how[0], str) else ()
    rest = how[len(first) :]
    said_twice = (first and text[0] != text[1]) or (rest and number[0] != number[1])
    if said_twice or len(rest) > 1 or any(isinstance(one, str) for one in rest):
        raise Error(f"{', '.join(map(shown, how))} cannot be: right is {right}, each said once")
    return (*first, text[0])[0], (*rest, number[0])[0]


def _rate(variables: str, interval: Any, rate: Optional[float]) -> float:
    if rate is not None:
        raise Error(f"{named(variables)} has an interval of {shown(interval)} s and a rate of {shown(rate)}; right is one of them")
    if not isinstance(interval, (int, float)) or not 0 <= interval <= LONGEST_INTERVAL:
        least = f"the least time between two messages (s), from 0 to {LONGEST_INTERVAL:.0f}"
        raise Error(f"the interval of {named(variables)} is {shown(interval)}; right is {least}")
    return min(1 / interval, 1e9)
