"""Wrong tokens, counted by client: after a few of them a client has to wait, each time longer, up to a bound.

Only wrong tokens are made to wait. A right one is let in at once, whoever else has tried from its address: an attacker
behind the same address must not lock the operator out. So this does not protect a token that can be guessed, but the
logs and the processor; against guessing, tokens are long.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from service.access.addresses import subscriber

FREE_TRIES = 5
WINDOW_S = 300.0
LONGEST_WAIT_S = 60.0
MOST_CLIENTS = 10_000
_MOST_DOUBLINGS = 12  # 4096 s, which is more than may be set


@dataclass(slots=True)
class _Tries:
    count: int = 0
    last: float = -math.inf
    until: float = -math.inf


class FailedLogins:
    """Of one server process. Knows the `most` clients that failed last; the window begins anew with each try.

    A client may try `free` times, and waits `longest_wait_s` at most.
    """

    def __init__(
        self,
        free: int = FREE_TRIES,
        longest_wait_s: float = LONGEST_WAIT_S,
        most: int = MOST_CLIENTS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._free, self._longest_wait_s, self._most = free, longest_wait_s, most
        self._clock = clock
        self._clients: OrderedDict[str, _Tries] = OrderedDict()

    def __len__(self) -> int:
        return len(self._clients)

    def failed(self, address: str) -> float:
        """A wrong token came from there: how many seconds that client was to wait before it, 0 if it was free to try.

        A try that came too early counts too, so the wait of one who never stops goes up to the bound and stays there.
        """
        now, client = self._clock(), subscriber(address)
        tries = self._clients.pop(client, None)
        if tries is None or now > max(tries.last + WINDOW_S, tries.until):
            tries = _Tries()
        self._clients[client] = tries
        if len(self._clients) > self._most:
            self._clients.popitem(last=False)
        tries.count, tries.last = tries.count + 1, now
        early = now < tries.until
        if tries.count >= self._free:
            tries.until = now + min(self._longest_wait_s, 2.0 ** min(tries.count - self._free, _MOST_DOUBLINGS))
        return tries.until - now if early else 0.0
