"""Steps of rovers that a simulator drives, over one WebSocket or one request each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Self

from tenacity import AsyncRetrying

from rover_twin_client._async.connection import AsyncConnection
from rover_twin_client.concurrency.lock_async import AsyncLock
from rover_twin_client.concurrency.socket_async import AsyncSocket
from rover_twin_client.drives import Moment, Transport
from rover_twin_client.network import bridging
from rover_twin_client.stepping import LIVE_PATH, USUAL_DT_S, Rovers, RoverStep, only


class AsyncLive:
    """Steps rovers, one call after the other. Make it with `AsyncRoverTwin.live`, and use it in `async with`.

    Every answer brings the rover's state, so that nothing is lost when the connection breaks: the step is asked again
    from the last state, at whichever replica answers then. It is tried for at least 5 s, which bridges a restart of the
    service, and once only by a client with `retries=0`. Several tasks may share it: their calls queue up.
    """

    def __init__(self, connection: AsyncConnection, model: str | None, transport: Transport) -> None:
        if transport not in ("websocket", "http"):
            raise ValueError(f"transport is {transport!r}, allowed is 'websocket' or 'http'")
        self._connection = connection
        self._rovers = Rovers(model)
        self._socket = (
            AsyncSocket(connection._url, LIVE_PATH, connection._credentials) if transport == "websocket" else None
        )
        self._known: set[str] = set()  # to the other end of the present WebSocket
        self._turn = AsyncLock()
        self._tries = bridging(AsyncRetrying, connection._retries)
        self._closed = False

    def start(self, id: str, mass_kg: float, start_speed_m_s: float | None = None) -> None:  # noqa: A002
        """A rover of this mass that begins to move with its next step.

        Without a speed it is parked and let go, as in the simulations. A rover of the same `id` is forgotten. Raises
        InvalidInputError for what is not a number; the service checks ranges with the first step.
        """
        self._known.discard(id)
        self._rovers.start(id, mass_kg, start_speed_m_s)

    def resume(self, states: Mapping[str, str]) -> None:
        """Rovers that go on from states (`states`), which another client or another service may have answered."""
        self._known.difference_update(states)
        self._rovers.resume(states)

    def forget(self, id: str) -> None:  # noqa: A002
        """Drops a rover here. The service drops it with the connection."""
        self._rovers.forget(id)

    @property
    def states(self) -> dict[str, str]:
        """The last state of each rover that has moved."""
        return self._rovers.states

    async def step(
        self,
        id: str,  # noqa: A002
        slope_deg: float,
        torque_nm: float | None = None,
        dt_s: float = USUAL_DT_S,
        *,
        brake: bool = False,
    ) -> Moment:
        """Moves one rover on by `dt_s` seconds under this slope and torque, or with locked wheels.

        `slope_deg` is the slope under the rover's middle, `torque_nm` the stall torque of each wheel's motor: needed
        unless `brake`, and 0 where the wheels are to turn freely. Raises InvalidInputError for a value out of range and
        for a rover that was not started; the rover then stays where it was. Raises ConnectionFailedError when nobody
        answers for 5 s, TimedOutError when an answer takes too long, and RuntimeError after `aclose`.
        """
        return only(await self.step_many([RoverStep(id, slope_deg, torque_nm, brake, dt_s)]), id)

    async def step_many(self, steps: Iterable[RoverStep]) -> list[Moment]:
        """Moves many rovers on at once, each by its own `dt_s`: their moments in the same order.

        Raises what `step` raises, for the first rover that was refused; the others have moved then.
        """
        asked = list(steps)
        async with self._turn:
            moments: list[Moment] = await self._tries(self._attempt, asked)
            return moments

    async def _attempt(self, steps: list[RoverStep]) -> list[Moment]:
        """One try. What was answered has its state here, what was not is asked again from there."""
        if self._closed:
            raise RuntimeError("this live connection was closed: make another one, and `resume` the states there")
        if self._socket is None:
            return await self._connection._attempt(self._rovers.call(steps), None)
        if not self._socket.is_open:
            self._known.clear()
        moments = self._rovers.read(await self._socket.exchange(self._rovers.message(steps, self._known)))
        self._known.update(each.id for each in moments)
        return moments

    async def aclose(self) -> None:
        """Closes the connection, after the step that is under way; the states stay readable."""
        self._closed = True
        async with self._turn:
            if self._socket is not None:
                await self._socket.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()
