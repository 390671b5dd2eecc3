"""How many processors this process may really use: containers limit time, not the count that the host shows."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from service import parts

CGROUP_ROOT = Path("/sys/fs/cgroup")
CGROUP_MEMBERSHIP = Path("/proc/self/cgroup")
_V1_FOLDERS = ("cpu", "cpu,cpuacct", "cpuacct,cpu")


def available_cpus(root: Path = CGROUP_ROOT, membership: Path = CGROUP_MEMBERSHIP) -> int:
    """Processors by affinity and by the tightest cgroup quota (v2 `cpu.max`, v1 cfs), rounded up; at least 1.

    `root` and `membership` are where the kernel shows the cgroup tree and the process's place in it.
    """
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quotas = [quota for folder in _folders(root, membership) if (quota := _quota(folder)) is not None]
    return max(1, min([affinity, *(math.ceil(quota - 1e-9) for quota in quotas)]))


def limit_torch_threads(threads: int) -> None:
    """Give every torch operation at most `threads` threads, and run no two operations of one graph at once.

    Imports torch, which takes a second or two: for processes that need it anyway.
    """
    import torch  # noqa: PLC0415 - a service without networks does without

    torch.set_num_threads(threads)
    if torch.get_num_interop_threads() != 1:
        torch.set_num_interop_threads(1)  # torch allows this once, before the first parallel work


def limit_blas_threads(threads: int) -> None:
    """Give the linear algebra under numpy this many threads."""
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - looks through every loaded library

    threadpool_limits(threads, user_api="blas")


def limit_compute_threads(threads: int) -> None:
    """Give torch, and the linear algebra under numpy and scipy, this many threads: for what computes weights.

    Their last bits depend on the number of threads: the same number is needed to get the same weights again.
    """
    if parts.has(parts.TRAINING):  # without, nothing here computes weights, and numpy alone is left
        import scipy.linalg  # noqa: F401, PLC0415 - only libraries that are loaded can be limited
        import torch  # noqa: PLC0415

        torch.set_num_threads(threads)
    limit_blas_threads(threads)


def _folders(root: Path, membership: Path) -> Iterator[Path]:
    """Every cgroup folder that may limit us: our own and its ancestors, as v2 and as v1 mount them."""
    places = {PurePosixPath("/")}
    for line in _text(membership).splitlines():
        own = PurePosixPath(line.split(":", 2)[-1])
        if own.is_absolute() and ".." not in own.parts:
            places.update((own, *own.parents))
    for place in sorted(places):
        inside = place.relative_to("/")
        yield root / inside
        yield from (root / folder / inside for folder in _V1_FOLDERS)


def _quota(folder: Path) -> float | None:
    """The limit set in this very folder, in processors; None where it sets none."""
    limit, _, period = _text(folder / "cpu.max").strip().partition(" ")
    if not limit:
        limit = _text(folder / "cpu.cfs_quota_us").strip()
        period = _text(folder / "cpu.cfs_period_us").strip()
    try:
        quota, share = int(limit), int(period)
    except ValueError:  # "max", or nothing there
        return None
    return quota / share if quota > 0 and share > 0 else None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
