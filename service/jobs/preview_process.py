"""Drawing a dataset in a process of its own: reading and drawing take seconds, and predictions must not wait for them.

`main` is that process: a request on stdin, the figure on stdout; or exit code 3, and on stderr in one line what is
wrong with the dataset.
"""

from __future__ import annotations

import sys
from typing import Literal

from pydantic import BaseModel

from model_store import CorruptArtefactError, ModelStore, StoreError
from service import child, parts
from service.errors import DatasetError
from service.training.stored_dataset import RUNS_FILE

Kind = Literal["svg", "png", "html"]
WALL_S = 60
_CPU_S = 60
_REFUSED = 3


class _Request(BaseModel):
    store_url: str
    dataset: str
    kind: Kind


async def preview_in_process(store_url: str, dataset: str, kind: Kind) -> bytes:
    """The figure of a dataset, given by its id. When the awaiting task is cancelled, the process is killed.

    Raises CorruptArtefactError when what is stored cannot be drawn, TimeoutError after a minute, and MissingPartError
    where Matplotlib is not installed.
    """
    parts.require(parts.PICTURES, "the figure of a dataset")
    request = _Request(store_url=store_url, dataset=dataset, kind=kind)
    done = await child.ask("service.jobs.preview_process:main", request.model_dump_json().encode(), within_s=WALL_S)
    if done.returncode == 0 and done.stdout:
        return done.stdout
    why = done.stderr.decode("utf-8", "replace").strip() if done.returncode == _REFUSED else ""
    raise CorruptArtefactError(why or f"dataset {dataset} cannot be drawn: its process ended with {done.returncode}")


def main() -> None:
    """Read one request, write one figure."""
    # here, for the parent has no need of the libraries that read and draw
    from service.datasets import read_parquet  # noqa: PLC0415
    from service.training.dataset_figure import Origin, preview  # noqa: PLC0415

    request = _Request.model_validate_json(child.given_task())
    child.restrain(cpu_s=_CPU_S, wall_s=WALL_S)
    try:
        store = ModelStore.open(request.store_url)
        runs = store.read_dataset_file(request.dataset, RUNS_FILE)
        figure = preview(
            read_parquet(runs, columns=()), kind=request.kind, origin=Origin.of(store.dataset(request.dataset))
        )
    except (StoreError, DatasetError) as error:
        print(str(error).replace("\n", " "), file=sys.stderr)
        sys.exit(_REFUSED)
    sys.stdout.buffer.write(figure)
