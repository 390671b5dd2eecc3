"""Validating a folder without keeping its runs: the same report, in the memory of one run."""

from __future__ import annotations

import gc
import tracemalloc

import pyarrow as pa

from service.datasets import read_folder, validate_folder


def test_the_report_is_that_of_reading(folder, make_motion) -> None:
    folder.add("a.csv", make_motion(1.0), slope=20)
    folder.add("b.csv", make_motion(0.9), slope=20)  # the same scenario: a warning between runs
    folder.add("c.csv", make_motion(0.9), slope=24)  # b's rows: a rejection between runs
    folder.add("d.csv", make_motion(float("nan")), slope=25)
    for index, step in enumerate((0.1, 0.2)):
        changing = make_motion(0.8 - step)
        changing["slope_deg"] = step * changing["time_s"] / 10.0
        folder.add(f"e{index}.csv", changing, slope=0.0)
    folder.write()
    dataset, report = read_folder(folder.path)
    assert len(dataset.runs) == len(report.accepted) < 6
    assert {"duplicate-scenario", "duplicate-content", "scenario-range"} <= {str(each.code) for each in report.findings}
    assert validate_folder(folder.path) == report


def test_memory_does_not_grow_with_the_number_of_runs(folder, make_motion) -> None:
    files = 24
    for index in range(files):
        folder.add(f"{index}.csv", make_motion(1.0 - 0.01 * index, rows=4001), slope=20 + 0.1 * index)
    folder.write()
    of_one_run = 4001 * 6 * 8
    kept = {}
    for read in (validate_folder, read_folder):
        gc.collect()
        before = pa.total_allocated_bytes()  # where the columns of text files lie
        tracemalloc.start()
        result = read(folder.path)
        gc.collect()
        kept[read] = tracemalloc.get_traced_memory()[0] + pa.total_allocated_bytes() - before
        tracemalloc.stop()
        del result
    assert kept[validate_folder] < 2 * of_one_run
    assert kept[read_folder] > 0.9 * files * of_one_run  # so the measure can tell


def test_an_intake_that_does_not_keep_still_counts_rows(make_motion, folder) -> None:
    folder.add("a.csv", make_motion(1.0)).add("b.csv", make_motion(0.9), slope=21).write()
    report = validate_folder(folder.path)
    assert report.summary is not None
    assert report.summary.rows == 402
