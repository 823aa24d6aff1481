"""Recorded runs."""

from __future__ import annotations

import os
from typing import Any, Dict, Iterator, Union

from ._elk import Error, LogReader, Message
from ._words import shown


class Log:
    """A recorded run: a log's file, or a run's folder.

        run = elk.Log("logs/apartment-…")
        run.table("POSE")      # pandas.DataFrame, or a dict of numpy arrays where there is no pandas
        for message in run: ...
    """

    def __init__(self, path: Union[str, "os.PathLike[str]"]) -> None:
        try:
            self._path = os.fsencode(path)
        except UnicodeEncodeError as why:
            raise Error(f"{shown(path)} is no path: {why}; right is a text that the system's files can have for a name") from why
        self._metadata: Dict[str, Any] = LogReader(self._path).metadata()

    def __iter__(self) -> Iterator[Message]:
        """The messages, in the order in which they were recorded."""
        return iter(LogReader(self._path))

    @property
    def metadata(self) -> Dict[str, Any]:
        """Where the run came from: mission_name, mission, effective_mission, version, seed, world, run, started."""
        return self._metadata

    def variables(self) -> Dict[str, int]:
        """The variables that are in it, and how many messages of each."""
        return LogReader(self._path).variables()

    def columns(self, variable: str) -> Dict[str, Any]:
        """The numbers of a variable as numpy arrays by name: `time` (s, the community's clock) and `value`, or one for each
        number in a typed value (`pose.x` (m)); NaN where a message has none. Texts are in `text`."""
        return LogReader(self._path).columns(variable)

    def table(self, variable: str) -> Any:
        """The same as a pandas.DataFrame, if pandas is there."""
        columns = self.columns(variable)
        try:
            import pandas
        except ImportError:
            return columns
        return pandas.DataFrame(columns)
