"""Missions and evaluations, by the program `elk`."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

from ._elk import Error
from ._log import Log
from ._words import shown

PathLike = Union[str, "os.PathLike[str]"]


def _elk(*arguments: str) -> Tuple[int, str, str]:
    """Runs `elk` (`$ELK`, else the one in PATH) to its end: how it ended, and what it said. Who is interrupted meanwhile asks
    it to leave, which it does in good order."""
    program = os.environ.get("ELK") or shutil.which("elk")
    if program is None:
        raise Error("there is no program elk in PATH; cargo build --release makes it, and ELK=… says where it is")
    how = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    try:
        process = subprocess.Popen([program, *arguments], **how)
    except ValueError as error:
        raise Error(f"elk {arguments[0]} cannot be told this: {error}; right are texts without a zero or half a character") from error
    except OSError as error:
        raise Error(f"{program} cannot be run: {error}; ELK=… says where elk is") from error
    try:
        said, errors = process.communicate()
    except BaseException:
        process.terminate()
        process.communicate()
        raise
    return process.returncode, said, errors


def _failure(said: str, errors: str) -> Error:
    return Error((errors.strip() or said.strip()).removeprefix("elk: "))


class Run:
    """A run of a mission that is over.

    `folder` is what it left: its log, its map, a picture, the mission as it ran. `summary` is what it came to, as `summary.json`
    has it: `complete`, `reason`, `scans`, `path_length_m` (m), `contacts`, `seconds` (s), …"""

    def __init__(self, folder: PathLike) -> None:
        self.folder: Path = Path(folder)
        self.summary: Dict[str, Any] = json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))

    @property
    def complete(self) -> bool:
        """Whether all is explored that can be, and the robot touched nothing."""
        return self.summary["complete"]

    @property
    def log(self) -> Log:
        """What was said on the bus."""
        return Log(self.folder)

    def __repr__(self) -> str:
        return f"elk.Run({str(self.folder)!r})"


class Mission:
    """A mission: `mission` is its file, the name of a built-in one, or the folder of a run that is to be had again.

        mission = elk.Mission("car", {"Explorer.type": "Tour", "Map.Res": 0.2})
        run = mission.launch()
        print(run.summary["path_length_m"], run.log.table("PROGRESS"))

    `parameters` are said otherwise than there, as on a command line, `App.Param`, with their units where they have some
    (`elk types`): `type`, `exec` and `pipe` say what runs. Relative files are looked for from the working directory. It is the
    program `elk` that does it: `$ELK`, or the one in PATH."""

    def __init__(self, mission: PathLike, parameters: Optional[Mapping[str, Any]] = None) -> None:
        self.mission: str = _argument(mission)
        self.parameters: Dict[str, Any] = dict(parameters or {})

    def set(self, parameter: str, value: Any) -> "Mission":
        """Says a parameter (`"Map.Res"`) otherwise than the mission; answers the mission."""
        self.parameters[parameter] = value
        return self

    def _arguments(self) -> List[str]:
        # A flag is `true` in a mission, and no `True`; three numbers stand with semicolons between them.
        sets = [f"--set={name}={_text(value)}" for name, value in self.parameters.items()]
        return [self.mission, *sets]

    def check(self) -> str:
        """Checks the mission, its world, its start and its executables, and starts nothing; what was found, in words.

        Raises elk.Error with all that is wrong, each with where it stands."""
        code, said, errors = _elk("check", *self._arguments())
        if code:
            raise _failure(said, errors)
        return said

    def launch(
        self,
        *,
        community: Optional[str] = None,
        log_dir: PathLike = "logs",
        pace: Optional[float] = None,
        in_process: bool = False,
    ) -> Run:
        """Runs the mission and waits for its end, complete or not. `community`: others of the machine do not hear it, and without
        one it is `elk`; `log_dir`: where the run's folder is made; `pace`: how many times as fast as a robot it goes, without
        one as fast as it can; `in_process`: without processes of its own.

        Raises elk.Error: the mission is wrong, or it failed before there was anything to sum up."""
        how = ["--headless", "--auto", f"--log-dir={os.fspath(log_dir)}"]
        how += [] if community is None else [f"--community={community}"]
        how += [] if pace is None else [f"--pace={pace}"]
        how += ["--in-process"] if in_process else []
        code, said, errors = _elk("launch", *self._arguments(), *how)
        folders = [line.rpartition(": run ")[2] for line in said.splitlines() if ": run " in line]
        if not folders or not (Path(folders[0]) / "summary.json").exists():
            raise _failure(said, errors)
        return Run(folders[0])

    def __repr__(self) -> str:
        return f"elk.Mission({self.mission!r}, {self.parameters!r})"


def _argument(path: PathLike) -> str:
    """A path as an argument that is none of `elk`'s options."""
    text = os.fspath(path)
    if not isinstance(text, str) or not text or "\0" in text:
        raise Error(f"{shown(path)} is no path; right is a text, without a zero in it")
    return f"./{text}" if text.startswith("-") else text


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)) or hasattr(value, "tolist") and getattr(value, "ndim", 0):
        return "; ".join(str(float(one)) for one in value)
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def evaluate(suite: PathLike, output: PathLike, *, jobs: Optional[int] = None) -> List[Dict[str, Any]]:
    """Runs a suite, or what is left of it, and waits for its end: a row for each run, with the columns of `runs.csv` (`world`,
    `strategy`, `end`, `way_m` (m), `scans`, `contacts`, …). What is a number in all rows that have it is one, NaN where a row has
    none, so that `numpy.array([row["way_m"] for row in rows])` and `pandas.DataFrame(rows)` have columns of numbers.

    `output` is the folder of the results, with tables and pictures (`report.html`); what is in it already is not run again. `jobs`: so
    many runs at the same time, as many as there are processors if not said.

    Raises elk.Error: the suite is wrong, or the results in the folder are of another one."""
    how = [] if jobs is None else [f"--jobs={jobs}"]
    code, said, errors = _elk("evaluate", _argument(suite), f"--output={os.fspath(output)}", *how)
    # Not all complete is a result; it ends otherwise before it says where the results are.
    if code and not any(line.startswith("report.html") for line in said.splitlines()):
        raise _failure(said, errors)
    with open(Path(output) / "runs.csv", newline="", encoding="utf-8") as file:
        rows: List[Dict[str, Any]] = list(csv.DictReader(file))
    for name in rows[0] if rows else ():
        numbers = [_number(row[name]) for row in rows]
        if None not in numbers and any(row[name] for row in rows):
            for row, number in zip(rows, numbers):
                row[name] = number
    return rows


def _number(text: str) -> Union[int, float, None]:
    """The number that a cell says, NaN if it says nothing; None: it is a text."""
    if not text:
        return float("nan")
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return None
