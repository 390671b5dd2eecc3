"""A sheet as the bytes of a text file."""

from __future__ import annotations

from tests.datasets.messy.sheet import unit_of

MARKS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": " ", "aligned": " ", "comma and space": ", "}


def written(sheet, ways):
    """The text of a sheet, in lines with its comments and blanks, encoded."""
    mark = MARKS[ways["delimiter"]]
    rows = [[_quoted(cell, column, ways) for cell, column in zip(row, sheet.columns, strict=True)]
            for row in sheet.rows]  # fmt: skip
    names = [_quoted_name(column.header, ways) for column in sheet.columns]
    above = _above(sheet, names, ways)
    if ways["order"] == "cut off":
        rows[-1] = rows[-1][:-2]
    lines = _aligned([*above, *rows]) if ways["delimiter"] == "aligned" else [mark.join(row) for row in (*above, *rows)]
    lines = [line + mark.strip(" ") * _TRAILING[ways["trailing"]] for line in lines]
    if ways["order"] == "cut off":
        lines[-1] = lines[-1].rstrip(mark.strip(" ") + " ")
    heads, body = lines[: len(above)], lines[len(above) :]
    if ways["header"] == "title above":
        heads.insert(0, "Climb on regolith at 28 degrees")
    elif ways["header"] == "in a comment":
        heads[0] = f"# {heads[0]}"
    elif ways["header"] == "sep=":
        heads.insert(0, f"sep={mark.strip(' ')}")
    return _encoded(_with_noise(heads, body, mark.strip(" ") * (len(names) - 1), ways), ways)


_TRAILING = {"none": 0, "one": 1, "two": 2}


def _above(sheet, names, ways):
    """The rows above the numbers."""
    if ways["index"] == "no name above":
        names = names[1:]
    style = ways["header"]
    if style in ("none", "none, mapped"):
        return []
    if style == "groups above":
        groups = [("" if not column.name else "rover" if column.name in ("time_s", "speed_mps") else "rear wheel")
                  for column in sheet.columns]  # fmt: skip
        return [groups, names]
    if style == "units below":
        return [names, [unit_of(column) for column in sheet.columns]]
    return [names]


def _quoted(cell, column, ways):
    if cell[:1] in ('"', "'") or ways["quoting"] in ("none", "header"):
        return cell
    if ways["quoting"] == "texts" and not column.is_text:
        return cell
    around = "'" if ways["quoting"] == "single" else '"'
    return f"{around}{cell}{around}"


def _quoted_name(name, ways):
    around = {"none": "", "single": "'"}.get(ways["quoting"], '"')
    return f"{around}{name}{around}"


def _aligned(rows):
    """Columns to the right, as `%14s` and pandas' to_string write them; a shorter row ends earlier or begins later."""
    count = max(map(len, rows))
    rows = [[""] * (count - len(row)) + row if at == 0 else row for at, row in enumerate(rows)]
    widths = [max(len(row[at]) for row in rows if at < len(row)) + 2 for at in range(count)]
    return ["".join(cell.rjust(width) for cell, width in zip(row, widths, strict=False)) for row in rows]


def _with_noise(heads, body, delimiters, ways):
    comment = {"before": "# by hand", "middle": "# paused, then 2 went on", "end": "# end", "//": "// 1", "%": "% note",
               "!": "! 3 4"}.get(ways["comments"])  # fmt: skip
    blank = {"empty lines": "", "delimiters": delimiters, "spaces": "    "}.get(ways["blank"])
    lines = list(heads)
    if ways["comments"] == "before":
        lines.insert(1 if ways["header"] == "sep=" else 0, comment)  # Excel looks at the very first line
    for at, line in enumerate(body):
        if at == 9 and comment is not None and ways["comments"] not in ("before", "end"):
            lines.append(comment)
        if blank is not None and at % 7 == 3:
            lines.append(blank)
        lines.append(line)
    return [*lines, comment] if ways["comments"] == "end" else lines


def _encoded(lines, ways):
    ends = {"CRLF": ("\r\n",), "CR": ("\r",), "mixed": ("\n", "\r\n")}.get(ways["ends"], ("\n",))
    text = "".join(line + ends[at % len(ends)] for at, line in enumerate(lines))
    if ways["ends"] == "none at the end" or ways["order"] == "cut off":
        text = text.rstrip("\r\n")
    elif ways["ends"] == "blank at the end":
        text += "\n\n"
    if ways["encoding"] == "byte-order mark":
        return b"\xef\xbb\xbf" + text.encode()
    if ways["encoding"].startswith("UTF-16"):
        coding = "utf-16-be" if ways["encoding"].endswith("big") else "utf-16-le"
        return ("" if ways["encoding"].endswith("no mark") else "\ufeff").encode(coding) + text.encode(coding)
    return text.encode("cp1252" if ways["encoding"] == "Windows-1252" else "utf-8")
