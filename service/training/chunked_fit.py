"""A fit in pieces of a few seconds, each of which starts from bytes that the one before it left behind."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from service.learning.network.fit import FitProgress
from service.learning.network.fit_state import FitState
from service.training.architectures import Callbacks, Fitted, NetworkRows, network_rows
from service.training.train import Prepared, fit_prepared

# Called after each epoch; true ends the piece there.
AfterEpoch = Callable[[FitProgress], bool]
Announce = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Chunk:
    """One piece: where the fit stands after it (None when there was nothing to fit), and whether it is finished."""

    state: FitState | None
    finished: bool


class ChunkedFit:
    """Pieces of one fit. Their sum is the undisturbed fit, bit for bit, on the same machine with the same threads."""

    def __init__(self, prepared: Prepared) -> None:
        self._prepared = prepared
        self._rows: NetworkRows | None = None

    @property
    def in_pieces(self) -> bool:
        """Whether this architecture is fitted by epochs; the others are solved in one go."""
        return self._prepared.config.architecture != "resistance_process"

    def advance(self, state: FitState | None, seconds: float, after_epoch: AfterEpoch) -> Chunk:
        """Go on from `state` for at least one epoch and about `seconds`. Raises what `after_epoch` raises."""
        patience = self._prepared.config.fit.patience_epochs
        started = time.monotonic()

        def on_epoch(reached: FitProgress, make_state: Callable[[], FitState]) -> None:
            finished = reached.epoch >= reached.epochs or reached.epoch - reached.best_epoch >= patience
            if after_epoch(reached) or finished or time.monotonic() - started >= seconds:
                raise _EndOfChunkError(Chunk(make_state(), finished))

        try:
            self._fit(Callbacks(_silent, on_epoch, state, self._network_rows()))
        except _EndOfChunkError as end:
            return end.chunk
        return Chunk(None, finished=True)

    def finish(
        self, state: FitState | None, elapsed_s: float, announce: Announce, check: Callable[[], None] = lambda: None
    ) -> Fitted:
        """The fitted model; with a state the best epoch up to there, which took `elapsed_s`. Fits no epoch more.

        An architecture that is not fitted in pieces is solved here; `announce` may raise to stop that, and so may
        `check`, which is called every second or so.
        """
        if state is None:
            return self._fit(Callbacks(announce, rows=self._network_rows(), check=check))
        config = self._prepared.config.fit
        callbacks = Callbacks(announce, resume=state, rows=self._network_rows())
        fitted = fit_prepared(self._prepared, callbacks, fit=replace(config, epochs=max(1, state.epoch)))
        outcome = replace(fitted.outcome, stopped_early=state.epoch < config.epochs, elapsed_s=elapsed_s)
        return replace(fitted, outcome=outcome)

    def _fit(self, callbacks: Callbacks) -> Fitted:
        return fit_prepared(self._prepared, callbacks)

    def _network_rows(self) -> NetworkRows | None:
        if self._rows is None and self.in_pieces:
            prepared = self._prepared
            self._rows = network_rows(prepared.config, prepared.split.train, prepared.data, prepared.prior)
        return self._rows


class _EndOfChunkError(Exception):
    """How a fit is left from its callback."""

    def __init__(self, chunk: Chunk) -> None:
        super().__init__("end of a piece of the fit")
        self.chunk = chunk


def _silent(_phase: str) -> None:
    """Pieces of a fit have nothing to announce."""
