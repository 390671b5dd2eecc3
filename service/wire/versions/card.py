"""The card of a version: what it was made from, how good it is on runs it has not seen, where it must not be used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, Field

from model_store import WEIGHTS, CorruptArtefactError, Manifest, ModelStore, NotFoundError, UnsupportedFormatError
from service.learning.domain import FIELDS
from service.training.regimes import LeftOutRun, RegimeErrors, Spread, by_regime, left_out_runs

LARGE_M = 0.25
"""A regime whose 90th percentile of the final error is larger is warned of."""
FEW_RUNS = 10
_WORST_SHARE = 0.05  # of times that a band may miss its level by
_WHOLE = 0.6
_MOST_FIGURES, _MOST_FIGURE_BYTES = 6, 1 << 20
_UNITS = {"slope_deg": "°", "mass_kg": " kg", "torque_nm": " N m", "torque_ratio": "", "horizon_s": " s"}
_NAMES = {
    "slope_deg": "slope", "mass_kg": "mass", "torque_nm": "torque", "torque_ratio": "torque ratio",
    "horizon_s": "horizon",
}  # fmt: skip


class SpreadAnswer(BaseModel):
    """Over the runs of a regime, m."""

    median_m: float
    p90_m: float


class RegimeAnswer(BaseModel):
    """Left-out runs of one kind: how far predictions are from Chrono at the end (`final`) and over time (`rmse`)."""

    regime: str
    runs: int
    final: SpreadAnswer
    rmse: SpreadAnswer
    prior_final: SpreadAnswer | None


class DatasetOf(BaseModel):
    """A dataset that the version was made from; `name` says so where it is no longer in the store."""

    id: str
    name: str


class CardAnswer(BaseModel):
    """A version for people who decide whether to use it."""

    name: str
    version: int
    state: Annotated[str, Field(description="`published`, `archived` or `deleted`.")]
    description: str
    created_at: datetime
    created_by: str
    architecture: str | None
    prior: str | None
    job: str | None
    datasets: list[DatasetOf]
    runs: Annotated[dict[str, int], Field(description="How many runs it was trained and tested on.")]
    seed: int | None
    code_version: str | None
    command: str | None
    weights_sha256: str | None
    same_weights_as: str | None
    domain: Annotated[dict[str, list[float]], Field(description="Lowest and highest value among the training runs.")]
    left_out_runs: int
    regimes: Annotated[list[RegimeAnswer], Field(description="Errors on runs it was not made from, by regime.")]
    band: Annotated[
        dict[str, Any] | None,
        Field(description="How often the band held, by regime, at `level`; null without a band or a measurement."),
    ]
    not_for: Annotated[list[str], Field(description="Where it must not be used, or only with care, in sentences.")]


@dataclass(frozen=True, slots=True, eq=False)
class Card:
    """The answer, with the runs that a picture of it shows and the figures that the version brings along."""

    answer: CardAnswer
    runs: Sequence[LeftOutRun]
    figures: Mapping[str, bytes]

    @property
    def version(self) -> str:
        """Its name, as name@number."""
        return f"{self.answer.name}@{self.answer.version}"


def card_of(store: ModelStore, manifest: Manifest, *, with_figures: bool = False) -> Card:
    """Reads the names of datasets and, if asked, the figures. Raises CorruptArtefactError and what the store raises."""
    lineage, checkpoint = manifest.lineage, manifest.checkpoint
    split = lineage.split if isinstance(lineage.split, dict) else {}
    runs = left_out_runs(manifest)
    regimes, spans = by_regime(runs), _spans(manifest)
    state, _ = store.version_state(manifest.name, manifest.version)
    measured = _measured(manifest)
    answer = CardAnswer(
        name=manifest.name,
        version=manifest.version,
        state=str(state),
        description=manifest.description,
        created_at=manifest.created_at,
        created_by=manifest.created_by,
        architecture=_name_in(checkpoint.get("architecture")),
        prior=_name_in(checkpoint.get("prior")),
        job=lineage.job,
        datasets=[DatasetOf(id=each, name=_dataset_name(store, each)) for each in lineage.datasets],
        runs={part: len(names) for part, names in split.items() if isinstance(names, list)},
        seed=lineage.seed,
        code_version=lineage.code_version,
        command=lineage.command,
        weights_sha256=manifest.files[WEIGHTS].sha256 if WEIGHTS in manifest.files else None,
        same_weights_as=lineage.same_weights_as,
        domain=spans,
        left_out_runs=len(runs),
        regimes=[regime_answer(each) for each in regimes],
        band=measured,
        not_for=list(_warnings(manifest, str(state), spans, regimes, measured)),
    )
    return Card(answer, runs, _figures(store, manifest) if with_figures and state != "deleted" else {})


def regime_answer(errors: RegimeErrors) -> RegimeAnswer:
    """As it stands in an answer."""
    return RegimeAnswer(
        regime=errors.regime,
        runs=errors.runs,
        final=spread_answer(errors.final),
        rmse=spread_answer(errors.rmse),
        prior_final=None if errors.prior_final is None else spread_answer(errors.prior_final),
    )


def spread_answer(spread: Spread) -> SpreadAnswer:
    """As it stands in an answer."""
    return SpreadAnswer(median_m=spread.median_m, p90_m=spread.p90_m)


def counted(runs: int) -> str:
    """How many runs."""
    return "1 run" if runs == 1 else f"{runs} runs"


def span_words(field: str, span: Sequence[float]) -> str:
    """A range with its name and unit."""
    return f"{_NAMES.get(field, field)} {span[0]:.4g} to {span[1]:.4g}{_UNITS.get(field, '')}"


def _warnings(
    manifest: Manifest,
    state: str,
    spans: Mapping[str, Sequence[float]],
    regimes: Sequence[RegimeErrors],
    measured: Mapping[str, Any] | None,
) -> Iterator[str]:
    if state != "published":
        yield f"For anything: it is {state}."
    if spans:
        yield f"Outside its domain: {'; '.join(span_words(field, span) for field, span in spans.items())}."
        yield "For combinations of slope, torque and mass that no run was near: the domain in an answer says so."
    if not regimes:
        yield "Where errors matter: no run was left out, so its errors on runs it has not seen are not known."
    for each in regimes:
        if each.final.p90_m > LARGE_M:
            yield (
                f"For positions without a margin, in the regime “{each.regime}”: one in ten of {each.runs} left-out "
                f"runs ended more than {each.final.p90_m:.2f} m from Chrono's."
            )
        elif each.runs < FEW_RUNS:
            yield f"As if measured, in the regime “{each.regime}”: only {counted(each.runs)} left out there."
    yield from _of_band(manifest, measured)
    yield "As a measurement of the Moon: what it was made from are simulations of one rover on one soil."


def _of_band(manifest: Manifest, measured: Mapping[str, Any] | None) -> Iterator[str]:
    if manifest.band is None:
        yield "Where risk matters: it has no band, so nothing says how sure an answer is."
        return
    if measured is None:
        return
    for name, each in measured["regimes"].items():
        if each["pointwise"] < measured["level"] - _WORST_SHARE:
            yield (
                f"With the band as a promise, in “{name}”: at {measured['level']:.0%} it held at "
                f"{each['pointwise']:.0%} of times."
            )
        elif each["whole"] < _WHOLE:
            held = f"{each['whole']:.0%}"
            yield f"With the band as a promise for whole runs, in “{name}”: it held {held} of them throughout."


def _measured(manifest: Manifest) -> dict[str, Any] | None:
    """Coverage by regime, as `Doubt.measured` writes it; None where there is nothing of that kind."""
    found: Any = manifest.metrics.get("doubt")
    if not isinstance(found, dict) or manifest.band is None:
        return None
    try:
        regimes = {
            str(name): {part: float(each[part]) for part in ("runs", "pointwise", "whole")}
            for name, each in found["regimes"].items()
        }
        return {"level": float(found["level"]), "regimes": regimes}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        where = f"metrics.doubt of {manifest.name}@{manifest.version}"
        raise CorruptArtefactError(f"{where} is not what this program writes; publish the version anew") from error


def _spans(manifest: Manifest) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    for field in FIELDS:
        span = manifest.domain.get(field)
        if isinstance(span, list) and len(span) == 2:
            found[field] = [float(each) for each in span if isinstance(each, int | float)]
    return found


def _dataset_name(store: ModelStore, identity: str) -> str:
    try:
        return store.dataset(identity).name
    except NotFoundError:
        return "no longer in the store"
    except (CorruptArtefactError, UnsupportedFormatError):
        return "its record is damaged"


def _figures(store: ModelStore, manifest: Manifest) -> dict[str, bytes]:
    """The drawings of its report by their names, the first few in the order of the alphabet."""
    names = [path for path in sorted(manifest.files) if path.startswith("report/") and path.endswith(".svg")]
    return {
        path.removeprefix("report/").removesuffix(".svg"): store.read_file(
            manifest, path, limit_bytes=_MOST_FIGURE_BYTES
        )
        for path in names[:_MOST_FIGURES]
        if manifest.files[path].size_bytes <= _MOST_FIGURE_BYTES
    }


def _name_in(part: object) -> str | None:
    name = part.get("name") if isinstance(part, Mapping) else None
    return None if name is None else str(name)
