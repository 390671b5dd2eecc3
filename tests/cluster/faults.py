"""Each part of a cluster is killed under steady load and started again: failed requests, time until all is well.

    python -m tests.cluster.faults

One row per part. Before the kill an upload, an alias move and a training job are acknowledged by one API; afterwards
the other one must know them, and the job must have made exactly one version.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.api.chrono_uploads import archive
from tests.api.conftest import publish_version
from tests.cluster.load import ELSEWHERE, KINDS, Load
from tests.cluster.machines import APIS, DATASETS, JOBS, Machines, until
from tests.databases import start_postgres
from tests.s3 import S3Server

PARTS = ("api-a", "worker", "database", "bucket")
DOWN_S = 3.0
DEADLINE_S = 240.0
_BEFORE_S = 1.0
_JOB = {
    "datasets": ["unit"],
    "architecture": "paper_network",
    "split": {"test_slopes_deg": [12]},
    "budget": {"max_epochs": 80},
}
_CHAMPION = "/v1/models/viper-lunar/aliases/champion"
_ALIAS = "/v1/models/viper-lunar/aliases/by-hand"


@dataclass
class Row:
    """What one kill did. Times are seconds after the kill."""

    part: str
    load: Load
    job: dict
    versions: list[int]
    lost: list[str]
    well_s: float
    job_s: float

    def failures(self, kind: str) -> tuple[int, int]:
        """Failed and asked."""
        lanes = self.load.of(kind)
        return sum(lane.failures() for lane in lanes), sum(len(lane.asked) for lane in lanes)

    def markdown(self) -> str:
        """A line of the table."""
        counts = [f"{failed} of {asked}" for failed, asked in map(self.failures, (*KINDS, ELSEWHERE))]
        ended = self.job["state"] if self.job["state"] == "succeeded" else f"failed: {self.job['failure']}"
        made = f"{ended}, {len(self.versions)} version, after {self.job_s:.0f} s"
        lost = "; ".join(self.lost) or "nothing"
        return f"| {self.part} | {' | '.join(counts)} | {self.well_s:.1f} s | {made} | {lost} |"


HEADING = (
    f"| killed for {DOWN_S:g} s | {' | '.join(f'failed {kind}' for kind in (*KINDS, ELSEWHERE))} "
    "| all well again after | the job that ran | acknowledged and lost |\n" + "|---" * 8 + "|"
)


def kill(machines: Machines, part: str) -> Row:
    """Kill a part under load while a job runs, start it again, wait until all is well and look at what is there."""
    number = PARTS.index(part) + 1
    promised = _promises(machines, number)
    with Load(machines) as load:
        until(load.all_good, DEADLINE_S, "all is well before the kill")
        time.sleep(_BEFORE_S)
        job_id = _submit(machines, number)
        running = until(lambda: machines.runner(job_id), DEADLINE_S, "a worker takes the job")
        victim = running if part == "worker" else part
        until(lambda: (machines.job(job_id).get("progress") or {}).get("epoch"), DEADLINE_S, "the job has begun")
        killed = time.monotonic()
        machines.kill(victim)
        time.sleep(DOWN_S)
        machines.start(victim)
        until(load.all_good, DEADLINE_S, f"all is well after {part} was killed")
        well = max(filter(None, (lane.recovered_at() for lane in load.lanes.values())), default=killed)
        job = machines.ended(job_id, DEADLINE_S)
        job_s = time.monotonic() - killed
    versions = machines.versions_of(job_id, f"rover-{number}")
    lost = [what for what, kept in promised.items() if not kept()]
    return Row(part, load, job, versions, lost, max(well - killed, 0.0), job_s)


def _submit(machines: Machines, number: int) -> str:
    answer = machines.api("api-a").post(JOBS, json=_JOB | {"model": f"rover-{number}", "seed": number})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def _promises(machines: Machines, number: int) -> dict[str, Callable[[], bool]]:
    """What one API acknowledges now, and how to see at the other one that it is kept."""
    sent = machines.api("api-a").post(DATASETS, content=archive(seed=1e-4 * number))
    assert sent.status_code == 201, sent.text
    identity = sent.json()["id"]
    known = machines.api("api-a").get(_ALIAS).headers.get("ETag")
    condition = {"If-Match": known} if known else {"If-None-Match": "*"}
    moved = machines.api("api-a").put(_ALIAS, json={"version": 1, "reason": f"move {number}"}, headers=condition)
    assert moved.status_code in (200, 201), moved.text
    other, seq = machines.api("api-b"), moved.json()["seq"]
    return {
        "the upload": lambda: other.get(f"{DATASETS}/{identity}").json()["id"] == identity,
        "the alias move": lambda: other.get(_ALIAS).json()["seq"] == seq,
    }


def follow(machines: Machines) -> dict[str, float]:
    """Promote a new version at one API; seconds until each of them answers with it."""
    version = publish_version(machines.store, coefficient=0.2)
    tag = machines.api("api-a").get(_CHAMPION).headers["ETag"]
    content = {"version": version, "reason": "the next one"}
    began = time.monotonic()
    moved = machines.api("api-b").put(_CHAMPION, json=content, headers={"If-Match": tag})
    assert moved.status_code == 200, moved.text
    took = {}
    for name in APIS:
        until(lambda name=name: machines.served(name, "viper-lunar@champion") == version, DEADLINE_S, f"{name} follows")
        took[name] = time.monotonic() - began
    return took


@contextmanager
def cluster() -> Iterator[Machines]:
    """All machines, in a folder of their own."""
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="cluster"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        postgres = stack.enter_context(contextmanager(start_postgres)())
        bucket = stack.enter_context(S3Server.started(folder / "bucket"))
        yield stack.enter_context(Machines(folder, postgres, bucket))


def main() -> int:
    """Print the table."""
    with cluster() as machines:
        print(HEADING, flush=True)
        for part in PARTS:
            print(kill(machines, part).markdown(), flush=True)
        print(
            "\nan alias moved at api-b:", *(f"{name} follows after {s:.1f} s" for name, s in follow(machines).items())
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
