"""Thousands of messy files: each one is the same run with the same numbers, or refused with a reason that names why.

`python -m tests.datasets.messy` prints how many came out how.
"""

from __future__ import annotations

import collections
import itertools

import pytest

from tests.datasets.messy.axes import AXES, CLEAN, is_possible
from tests.datasets.messy.files import MessyFile, every_way, files
from tests.datasets.messy.oracle import Read, judged, read

SHARDS = 16


@pytest.mark.slow
@pytest.mark.parametrize("shard", range(SHARDS))
def test_every_file_is_the_same_run_or_refused_with_its_reason(shard, tmp_path):
    outcomes, complaints = collections.Counter(), []
    for file in files(shard, SHARDS):
        verdict = judged(file, read(file, tmp_path))
        outcomes[verdict.outcome] += 1
        if verdict.complaint:
            complaints.append(f"{file.chosen}: {verdict.outcome}: {verdict.complaint}")
    print(dict(outcomes))
    assert outcomes["alike"] > 20
    assert not complaints, "\n".join([f"{len(complaints)} files:", *complaints[:10]])


@pytest.mark.slow
def test_there_are_more_than_five_thousand_of_them():
    assert len({file.digest for file in itertools.islice(files(), 5500)}) > 5000


def test_every_pair_of_values_that_can_be_together_is_in_a_file():
    pairs = {pair for ways in every_way() for pair in itertools.combinations(sorted(ways.items()), 2)}
    for one, other in itertools.combinations(sorted(AXES), 2):
        for a, b in itertools.product(AXES[one], AXES[other]):
            if is_possible({**CLEAN, one: a.name, other: b.name}):
                assert ((one, a.name), (other, b.name)) in pairs


def test_the_files_are_always_the_same():
    one, other = (next(files(5, 100)) for _ in range(2))
    assert (one.data, one.form) == (other.data, other.form)


def test_the_clean_file_is_read_without_a_word(tmp_path):
    file = MessyFile(CLEAN)
    answer = read(file, tmp_path)
    assert answer.findings == ()
    assert judged(file, answer).complaint is None


def test_a_wrong_answer_is_noticed(tmp_path):
    """The judge itself: other numbers, a run that is lost, a word that is missing, a reason of something else."""
    file = MessyFile(CLEAN)
    right = read(file, tmp_path)
    other = read(MessyFile({**CLEAN, "order": "a row missing"}), tmp_path)
    titled = MessyFile({**CLEAN, "header": "title above"})
    rejection = (("units", "reject", "rear_x_m: looks like millimetres"),)
    assert "other values" in judged(file, other).complaint
    assert "no reason" in judged(file, Read((), ())).complaint
    assert "not told" in judged(titled, right).complaint
    assert "without a cause" in judged(file, Read(right.runs, (("comment", "warn", "not read"),))).complaint
    assert "clean file is refused" in judged(file, Read((), rejection)).complaint
    assert "names no cause" in judged(MessyFile({**CLEAN, "hole": "nan"}), Read((), rejection)).complaint
    assert "accepted, though" in judged(MessyFile({**CLEAN, "hole": "nan"}), right).complaint
