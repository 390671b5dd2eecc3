"""Names from outside: which are safe to write, and how any is shown."""

from __future__ import annotations

import re
import unicodedata
from pathlib import PurePosixPath

_LONGEST_SHOWN = 160
_LONGEST_RUN_NAME = 200
_LONGEST_QUOTED = 80
_OF_DESKTOPS = ("__MACOSX", ".DS_Store", "Thumbs.db", "desktop.ini")
# what other systems read as something else: separators, drives, streams
_FOREIGN = re.compile(r"\\|^[A-Za-z]:|^~")


def printable(text: str) -> str:
    """One line that UTF-8 can carry: escaped is what a terminal would obey or JSON cannot hold."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def shown(name: str) -> str:
    """The name in printable characters, shortened: fit for a line of a terminal and for JSON."""
    text = printable(name)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def quoted(text: str) -> str:
    """A text of a file, as a header cell, in quotes and shortened: fit for a message."""
    return repr(text if len(text) <= _LONGEST_QUOTED else f"{text[:_LONGEST_QUOTED]}...")


def upload_name(filename: str) -> str:
    """What a sender calls a file, without folders (of any system), as `shown`; "upload" if nothing is left."""
    return shown(re.split(r"[/\\]", filename.strip())[-1].strip(". ")) or "upload"


def name_fault(name: str, *, path_length: int, depth: int) -> str | None:
    """Why a file of this name must not be written, or None when it may be."""
    path = PurePosixPath(name)
    if not name.strip() or not path.parts:
        return "is empty"
    if any(unicodedata.category(each) in {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"} for each in name):
        return "has control characters or no valid text"
    if len(name.encode()) > path_length or any(len(part.encode()) > 255 for part in path.parts):
        return f"is longer than {path_length} bytes, or a part of it longer than 255"
    if path.is_absolute() or _FOREIGN.search(name):
        return "is absolute, has a drive letter or a backslash; write relative names with /"
    if ".." in path.parts:
        return "leads out of its folder"
    if len(path.parts) > depth:
        return f"is {len(path.parts)} folders deep, allowed are {depth}"
    return None


def run_name(text: str) -> tuple[str, str | None]:
    """What a run is called that its file calls `text`, and why it cannot be called so, or None when it can.

    Names become files when a dataset is exported. So they are relative, with / between folders, in composed letters
    (NFC), without control characters, without spaces and dots at the end, and not longer than 200 characters.
    """
    path = PurePosixPath(unicodedata.normalize("NFC", text.strip()).replace("\\", "/"))
    parts = ["".join(each if each.isprintable() else "_" for each in part).strip().rstrip(". ") for part in path.parts]
    name = "/".join(parts)[:_LONGEST_RUN_NAME].rstrip("/. ")
    if path.is_absolute() or re.match("[A-Za-z]:", name):
        return name, "is absolute or has a drive letter; write a relative name"
    if ".." in path.parts:
        return name, "leads out of its folder"
    if not name or not all(parts):
        return name, "is empty, or a part of it is only dots"
    return name, None


def is_of_desktop(name: str) -> bool:
    """Whether desktops add such a file by themselves."""
    parts = PurePosixPath(name).parts
    return any(part in _OF_DESKTOPS for part in parts) or (bool(parts) and parts[-1].startswith("._"))


def folded(name: str) -> str:
    """Equal for two names that some file system takes for one."""
    return unicodedata.normalize("NFC", PurePosixPath(name).as_posix()).casefold()
