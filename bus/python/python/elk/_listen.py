"""An asyncio iterator over messages."""

from __future__ import annotations

import asyncio
from typing import Any, List, Optional

from ._comms import comms
from ._elk import Error, Message
from ._words import shown


class listen(comms):
    """A client of a community whose messages come in an asyncio loop:

        async with elk.listen("elk", "listener", ["NAV_*"]) as bus:
            async for message in bus:
                bus.notify("SEEN", message.time())
    """

    def __init__(self, community: str, name: str, variables: List[str], **how: Any) -> None:
        super().__init__()
        if isinstance(variables, (str, bytes)):
            raise Error(f"listen(…, {shown(variables)}): right is a list of variables, as ['NAV_*']")
        self._community, self._name, self._variables, self._how = community, name, list(variables), how
        self._loop: Optional[asyncio.AbstractEventLoop] = None
        self._news: Optional[asyncio.Event] = None
        self._is_over = False

    async def __aenter__(self) -> "listen":
        self._loop, self._news = asyncio.get_running_loop(), asyncio.Event()
        self.run(self._community, self._name)
        return self

    async def __aexit__(self, *_: Any) -> None:
        await asyncio.get_running_loop().run_in_executor(None, self.close)

    def __aiter__(self) -> "listen":
        return self

    async def __anext__(self) -> Message:
        if self._news is None:
            raise Error("listen is used with `async with`, and what it gives is iterated over")
        while True:
            # Looked at before the mail: what had come by the end is handed out.
            is_over = self._is_over
            message = self._waiting.next()
            if message is not None:
                return message
            self._check()
            if is_over:
                raise StopAsyncIteration
            await self._news.wait()
            self._news.clear()

    def _tell(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._news.set)
        except RuntimeError:
            pass  # the loop is closed: nobody waits

    def on_start_up(self) -> None:
        for variable in self._variables:
            self.register(variable, **self._how)
        super().on_start_up()

    def on_new_mail(self, message: Message) -> None:
        super().on_new_mail(message)
        if self._waiting.messages.qsize() == 1:
            self._tell()

    def _live(self) -> None:
        try:
            super()._live()
        finally:
            self._is_over = True
            self._tell()
