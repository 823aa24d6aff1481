"""What an app and `comms` have in common: a client of the bus, and what it says."""

from __future__ import annotations

import json
from typing import Any, Optional, Union

from ._elk import Runner
from ._lines import Lines


class Client:
    """A client of a community: what it says, from any thread."""

    _runner: Union[Runner, Lines]

    def register(
        self, variables: str, sources: str = "*", *, rate: Optional[float] = None, lossless: bool = False
    ) -> bool:
        """Hears these variables (a name, or a pattern with `*` and `?`) of these sources: the latest value of each, then all
        new ones, at most `rate` messages a second of each; with `lossless` its publishers wait for it."""
        self._runner.register(variables, sources, rate, lossless)
        return True

    def unregister(self, variables: str, sources: str = "*") -> bool:
        """Takes a registration back."""
        self._runner.unregister(variables, sources)
        return True

    def notify(
        self, variable: str, value: Any, time: Optional[float] = None, *, type: Optional[str] = None, source_aux: str = ""
    ) -> bool:
        """Publishes a value: a number, a text, bytes, or what a typed variable carries, as dicts, lists and numpy arrays.

        The type is what the variable carries, or what its readers read there; `type` names one of the community's for a
        variable of which nobody has said it. `time` is when it was so (s, the community's clock), if not now."""
        self._runner.publish(variable, value, time, type, source_aux)
        return True

    def notify_binary(self, variable: str, value: bytes, time: Optional[float] = None) -> bool:
        """Publishes bytes, as MOOS' clients do."""
        return self.notify(variable, bytes(value), time)

    def describe(self, variable: str) -> Optional[dict]:
        """What a variable carries: `type`, and of a typed one an `example` value and its `description` (fields, units, docs);
        None if nobody has said."""
        said = self._runner.describe(variable)
        return None if said is None else json.loads(said)
