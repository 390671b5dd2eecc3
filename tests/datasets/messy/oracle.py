"""What a file became, and whether that is right: the same runs with the same numbers, or a refusal that says why."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from service.datasets import RejectedDatasetError, Run
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from tests.datasets.messy.axes import ARCHIVES, LONG, TOGETHER, VALUES, WITHOUT_NAMES
from tests.datasets.messy.clean import MASS_KG, NAMES, TORQUE_NM, clean_runs, passport


@dataclass(frozen=True)
class Verdict:
    """`outcome` is "alike", "alike, with a word" or "refused"; `complaint` says what is wrong about it, if anything."""

    outcome: str
    complaint: str | None = None


@dataclass(frozen=True)
class Read:
    """What the intake made of a file: runs by name, and findings as (code, severity, message)."""

    runs: tuple[Run, ...]
    findings: tuple[tuple[str, str, str], ...]


def read(file, folder: Path) -> Read:
    """The intake's answer, as over HTTP and on the command line. Whatever is unpacked in `folder` is removed."""
    path, workspace = folder / "stored", folder / "workspace"
    path.write_bytes(file.data)
    workspace.mkdir(exist_ok=True)
    try:
        dataset, report = read_upload(
            path, filename="upload", workspace=workspace, form=UploadForm(passport=passport(), **file.form)
        )
        runs = dataset.runs
    except RejectedDatasetError as error:
        runs, report = (), error.report
    if any(workspace.iterdir()):
        shutil.rmtree(workspace)
    found = ((str(each.code), str(each.severity), f"{each.column or ''}: {each.message}") for each in report.findings)
    return Read(runs, tuple(found))


def judged(file, answer: Read) -> Verdict:
    """Whether this is right."""
    warned = [code for code, severity, _ in answer.findings if severity == "warn"]
    rejected = [(code, message) for code, severity, message in answer.findings if severity == "reject"]
    for run in answer.runs:
        fault = _difference(file, run)
        if fault:
            return Verdict("wrong", f"run {run.name}: {fault}")
    chosen = [VALUES[way] for way in file.ways.items()]
    together = [each for each in TOGETHER if each.holds(file.ways)]
    reasons = [reason for each in (*chosen, *together) for reason in each.refused]
    if rejected:
        return Verdict("refused", _unexplained(rejected, reasons))
    if len(answer.runs) != _runs_expected(file.ways):
        return Verdict("wrong", f"{len(answer.runs)} runs, and no reason")
    musts = [each for each in (*chosen, *together) if each.must and _matters(each, file.ways)]
    if musts:
        return Verdict("wrong", f"accepted, though it has {musts[0]}")
    known = {code for each in chosen for code in (*each.told, *each.may)} | {c for each in together for c in each.may}
    untold = [code for each in chosen for code in each.told if code not in warned and _is_said(each, file.ways)]
    odd = [code for code in warned if code not in known]
    complaint = f"not told: {untold}" if untold else f"told without a cause: {odd}" if odd else None
    return Verdict("alike, with a word" if warned else "alike", complaint)


def _matters(each, ways):
    """Whether what has to be refused is there at all."""
    mapped = ways["header"] in ("own names, mapped", "none, mapped")
    return not (mapped and each == VALUES["extra", "rear_x_m again"])


def _is_said(value, ways):
    """A column at the end that has neither a name nor a value is none."""
    return not (value == VALUES["extra", "empty"] and ways["header"] in WITHOUT_NAMES)


def _runs_expected(ways):
    return 2 if ways["carrier"] in (*LONG, *ARCHIVES) else 1


def _unexplained(rejected, reasons):
    """What is wrong with these rejections: at least one names a cause that the file has, and none another one."""
    if not reasons:
        return f"a clean file is refused: {rejected[0]}"
    if not any(code == rejected_code and re.search(words, message) for code, words in reasons
               for rejected_code, message in rejected):  # fmt: skip
        return f"the reason names no cause: {rejected[:2]}, expected {reasons}"
    odd = [each for each in rejected if each[0] not in {code for code, _ in reasons}]
    return f"another reason beside it: {odd[0]}" if odd else None


def _difference(file, run):
    """How an accepted run is another one than it was, or None."""
    ways = file.ways
    expected = next((each for each in clean_runs() if each.slope_deg == run.slope_deg), None)
    if expected is None or run.scenario[1:3] != (MASS_KG, TORQUE_NM):
        return f"scenario {run.scenario}"
    named = ways["carrier"] in ("long", "table in archive", *ARCHIVES)
    if named and run.name != expected.name:
        return f"called {run.name}, not {expected.name}"
    names = [name for name in NAMES if not (name == "speed_mps" and ways["units"] == "km/h by name")]
    if list(run.columns) != names:
        return f"columns {list(run.columns)}"
    relative = 5.1e-6 if ways["number"] == "six digits" else 1e-9
    absolute = 5.1e-7 if ways["number"] == "six decimals" else 1e-9
    kept = np.ones(len(expected.columns["time_s"]), dtype=bool)
    if ways["order"] == "a row missing" and expected is clean_runs()[0]:
        kept[20] = False
    for name in names:
        column = expected.columns[name][kept]
        if len(column) != len(run) or not np.allclose(run.columns[name], column, rtol=relative, atol=absolute):
            return f"other values of {name}"
    return None
