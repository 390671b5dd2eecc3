"""The CPU quota, as the kernel shows it in both generations of cgroups."""

from __future__ import annotations

import os

import pytest
import torch

from service.cpu import available_cpus, limit_torch_threads


@pytest.fixture(autouse=True)
def many_processors(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: set(range(64)), raising=False)


def tree(folder, files):
    for name, text in files.items():
        path = folder / "cgroup" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder / "cgroup"


CASES = {
    "no cgroups": ({}, None, 64),
    "v2 without limit": ({"cpu.max": "max 100000\n"}, "0::/\n", 64),
    "v2 two processors": ({"cpu.max": "200000 100000\n"}, "0::/\n", 2),
    "v2 rounds up": ({"cpu.max": "150000 100000\n"}, "0::/\n", 2),
    "v2 a tenth": ({"cpu.max": "10000 100000\n"}, "0::/\n", 1),
    "v2 own folder": ({"a/b/cpu.max": "300000 100000\n"}, "0::/a/b\n", 3),
    "v2 the parent is tighter": ({"a/cpu.max": "100000 100000\n", "a/b/cpu.max": "400000 100000\n"}, "0::/a/b\n", 1),
    "v1 quota": ({"cpu/cpu.cfs_quota_us": "250000\n", "cpu/cpu.cfs_period_us": "100000\n"}, "4:cpu,cpuacct:/\n", 3),
    "v1 nested": (
        {"cpu,cpuacct/d/x/cpu.cfs_quota_us": "50000\n", "cpu,cpuacct/d/x/cpu.cfs_period_us": "25000\n"},
        "4:cpu,cpuacct:/d/x\n",
        2,
    ),
    "v1 without limit": ({"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, "4:cpu:/\n", 64),
    "more than there are": ({"cpu.max": "9900000 100000\n"}, "0::/\n", 64),
    "nonsense": ({"cpu.max": "a lot\n", "cpu/cpu.cfs_quota_us": ""}, "0::/../..\nrubbish\n", 64),
    "a period of zero": ({"cpu.max": "100000 0\n"}, "0::/\n", 64),
}


@pytest.mark.parametrize("name", CASES)
def test_the_tightest_limit_counts(tmp_path, name):
    files, membership, expected = CASES[name]
    root = tree(tmp_path, files)
    if membership is not None:
        (tmp_path / "membership").write_text(membership)

    assert available_cpus(root, tmp_path / "membership") == expected


def test_affinity_counts_too(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {3, 5}, raising=False)

    assert available_cpus(tree(tmp_path, {"cpu.max": "800000 100000"}), tmp_path / "none") == 2


def test_torch_obeys():
    before = torch.get_num_threads()
    try:
        limit_torch_threads(1)
        assert torch.get_num_threads() == 1
        assert torch.get_num_interop_threads() == 1
    finally:
        torch.set_num_threads(before)
