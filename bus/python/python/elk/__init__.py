"""elk for Python: the bus over shared memory with MOOS' words, typed values as Python's own, logs as columns.

    import elk

    class Echo(elk.App):
        def on_start_up(self):
            self.register("SPEED")

        def on_new_mail(self, message):
            self.notify("SPEED_ECHO", message.double())

    Echo("echo").run()

`elk.comms()` has pymoos' names, and so have `elk.time()` and the functions beside it; `elk.listen` is an asyncio iterator,
`elk.Log` reads recorded runs, `elk.Mission` launches missions and `elk.evaluate` runs suites of them. Times are seconds of the
community's clock; lengths and poses are metres and the units that a type's description says (`Message.description()`).
"""

from ._app import App
from ._comms import comms
from ._elk import (
    DecodeError,
    Error,
    Message,
    Rejection,
    __version__,
    get_moos_timewarp,
    local_time,
    set_moos_timewarp,
    time,
)
from ._listen import listen
from ._log import Log
from ._mission import Mission, Run, evaluate

__all__ = [
    "App",
    "DecodeError",
    "Error",
    "Log",
    "Message",
    "Mission",
    "Rejection",
    "Run",
    "__version__",
    "comms",
    "evaluate",
    "get_moos_timewarp",
    "listen",
    "local_time",
    "set_moos_timewarp",
    "time",
]
