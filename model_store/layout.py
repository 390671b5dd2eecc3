"""Names and where they live inside the store.

    models/<name>/versions/<n>/{weights.safetensors, report/*, manifest.json}
    models/<name>/aliases/<alias>/<seq>.json
    models/<name>/once/<key>.json
    models/<name>/lifecycle/<seq>.json
    datasets/<sha256>/{..., dataset.json, names/<name>}
    jobs/<job id>/<file>

Every function that builds a path checks its parts first, so nothing from outside can point beyond its place.
All checks raise `InvalidReferenceError`.
"""

from __future__ import annotations

import re

from model_store.errors import InvalidReferenceError

WEIGHTS = "weights.safetensors"
MANIFEST = "manifest.json"
DATASET = "dataset.json"
NAMES = "names"
MODELS_ROOT = "models"
DATASETS_ROOT = "datasets"
WORK_ROOT = "jobs"
MAX_VERSION = 999_999_999
MAX_SEQ = 99_999_999

_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")
_ALIAS = re.compile(r"[a-z][a-z0-9-]{0,62}")
_VERSION = re.compile(r"[1-9][0-9]{0,8}")
_SEQ_FILE = re.compile(r"([0-9]{8})\.json")
_ONCE_KEY = re.compile(r"[a-z0-9][a-z0-9._-]{0,127}")
_JOB_ID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_DATASET_ID = re.compile(r"[0-9a-f]{64}")
_DATASET_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,62}")
_PLAIN_FILE = r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}"
_DATASET_FILE = re.compile(_PLAIN_FILE)
_WORK_FILE = re.compile(_PLAIN_FILE)
_VERSION_FILE = re.compile(rf"{re.escape(WEIGHTS)}|report/{_PLAIN_FILE}")


def check_name(name: str) -> str:
    """Return the model name when it is lower-case letters, digits and dashes, at most 63 of them."""
    return _checked("model name", name, _NAME, "a-z, 0-9 and '-', starting with a letter or digit, at most 63")


def check_alias(alias: str) -> str:
    """Return the alias when it starts with a letter and is otherwise formed like a model name."""
    return _checked("alias", alias, _ALIAS, "a-z, 0-9 and '-', starting with a letter, at most 63")


def check_version(version: int) -> int:
    """Return the version when it is an integer from 1 to 999,999,999."""
    if isinstance(version, bool) or not isinstance(version, int) or not 1 <= version <= MAX_VERSION:
        raise InvalidReferenceError(f"version {version!r} must be an integer from 1 to {MAX_VERSION}")
    return version


def check_version_file(file: str) -> str:
    """Return the file name when a version may hold it: the weights or `report/<plain name>`."""
    return _checked("file", file, _VERSION_FILE, f"'{WEIGHTS}' or 'report/<name>' with A-Z a-z 0-9 . _ -")


def check_once_key(once_key: str) -> str:
    """Return the key under which something is published once, when it is safe to use as a file name."""
    return _checked("once_key", once_key, _ONCE_KEY, "a-z 0-9 . _ -, starting with a letter or digit, at most 128")


def check_dataset_id(dataset_id: str) -> str:
    """Return the id when it is a lower-case hexadecimal sha256."""
    return _checked("dataset id", dataset_id, _DATASET_ID, "64 hexadecimal digits, lower case")


def check_dataset_name(name: str) -> str:
    """Return the dataset's human name when it is safe to print and to type."""
    return _checked("dataset name", name, _DATASET_NAME, "A-Z a-z 0-9 . _ -, at most 63")


def check_dataset_file(file: str) -> str:
    """Return the file name when a dataset may hold it: any plain name but `dataset.json`."""
    if file == DATASET:
        raise InvalidReferenceError(f"file {file!r} is written by the store itself; choose another name")
    return _checked("file", file, _DATASET_FILE, "a plain name with A-Z a-z 0-9 . _ -, at most 128")


def versions_prefix(name: str) -> str:
    """Where the versions of a model live."""
    return f"{MODELS_ROOT}/{check_name(name)}/versions"


def version_prefix(name: str, version: int) -> str:
    """Where one version lives."""
    return f"{versions_prefix(name)}/{check_version(version)}"


def once_record(name: str, once_key: str) -> str:
    """The path of the record that decides which version a key is published as."""
    return f"{MODELS_ROOT}/{check_name(name)}/once/{check_once_key(once_key)}.json"


def aliases_prefix(name: str) -> str:
    """Where the aliases of a model live."""
    return f"{MODELS_ROOT}/{check_name(name)}/aliases"


def alias_prefix(name: str, alias: str) -> str:
    """Where the records of one alias live."""
    return f"{aliases_prefix(name)}/{check_alias(alias)}"


def alias_record(name: str, alias: str, seq: int) -> str:
    """The path of one alias record."""
    return f"{alias_prefix(name, alias)}/{seq:08d}.json"


def lifecycle_prefix(name: str) -> str:
    """Where it is kept what became of the versions of a model."""
    return f"{MODELS_ROOT}/{check_name(name)}/lifecycle"


def lifecycle_record(name: str, seq: int) -> str:
    """The path of one record of that."""
    return f"{lifecycle_prefix(name)}/{seq:08d}.json"


def goes_with_deletion(file: str) -> bool:
    """Whether a file of a version goes when the version is deleted: what predicts does, what tells of it stays."""
    return file.endswith(".safetensors")


def check_job_id(job: str) -> str:
    """Return the job's id when it is a UUID in lower case."""
    return _checked("job id", job, _JOB_ID, "a UUID in lower case")


def work_prefix(job: str) -> str:
    """Where the work files of one job live."""
    return f"{WORK_ROOT}/{check_job_id(job)}"


def work_file(job: str, file: str) -> str:
    """The path of one work file of a job."""
    name = _checked("file", file, _WORK_FILE, "a plain name with A-Z a-z 0-9 . _ -, at most 128")
    return f"{work_prefix(job)}/{name}"


def dataset_prefix(dataset_id: str) -> str:
    """Where one dataset lives."""
    return f"{DATASETS_ROOT}/{check_dataset_id(dataset_id)}"


def dataset_name(dataset_id: str, name: str) -> str:
    """The path of the record that a dataset has this name too."""
    return f"{dataset_prefix(dataset_id)}/{NAMES}/{check_dataset_name(name)}"


def version_number(text: str) -> int | None:
    """The version a path segment or reference part names, or None when it is none (`03`, `latest`, `1#2`)."""
    return int(text) if _VERSION.fullmatch(text) else None


def record_seq(file: str) -> int | None:
    """The sequence number an alias record's file name carries, or None when it is no record."""
    found = _SEQ_FILE.fullmatch(file)
    return int(found.group(1)) or None if found else None


def is_name(text: str) -> bool:
    """Whether the text is a well-formed model name."""
    return _NAME.fullmatch(text) is not None


def is_alias(text: str) -> bool:
    """Whether the text is a well-formed alias."""
    return _ALIAS.fullmatch(text) is not None


def is_job_id(text: str) -> bool:
    """Whether the text is a well-formed job id."""
    return _JOB_ID.fullmatch(text) is not None


def is_dataset_name(text: str) -> bool:
    """Whether the text is a well-formed name of a dataset."""
    return _DATASET_NAME.fullmatch(text) is not None


def is_dataset_id(text: str) -> bool:
    """Whether the text is a well-formed dataset id."""
    return _DATASET_ID.fullmatch(text) is not None


def _checked(what: str, text: str, pattern: re.Pattern[str], allowed: str) -> str:
    if not isinstance(text, str) or pattern.fullmatch(text) is None:
        raise InvalidReferenceError(f"{what} {_shown(text)} is not allowed; use {allowed}")
    return text


def _shown(text: object) -> str:
    # what came from outside is quoted, never at full length
    shown = repr(text)
    return shown if len(shown) <= 100 else f"{shown[:100]}..."
