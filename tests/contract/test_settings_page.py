"""docs/settings.md is made from the settings themselves: `python -m tests.contract.test_settings_page` rewrites it."""

from __future__ import annotations

from pathlib import Path

from service.allowed import allowed_values
from service.settings import PREFIX, SECRETS, Settings

PAGE = Path(__file__).parent.parent.parent / "docs" / "settings.md"


def page() -> str:
    rows = []
    for name, field in Settings.model_json_schema()["properties"].items():
        default = field.get("default", "the store that ships with the service" if name == "store_url" else "unset")
        shown = "unset" if default is None else f"`{default}`" if name != "store_url" else default
        rows.append(f"| `{PREFIX}{name.upper()}` | {field['description']} | {allowed_values(field)} | {shown} |")
        if name in SECRETS:
            meaning = (
                f"File that has the value of `{PREFIX}{name.upper()}`, white space around it aside; set one of both."
            )
            rows.append(f"| `{PREFIX}{name.upper()}_FILE` | {meaning} | the path of a file | unset |")
    head = (
        "# Settings\n\nEnvironment variables of `rover-twin serve`. "
        "With a wrong value the service does not start, and one line says why.\n"
    )
    return f"{head}\n| variable | meaning | allowed | default |\n|---|---|---|---|\n" + "\n".join(rows) + "\n"


def test_the_page_shows_the_settings_as_they_are():
    assert PAGE.read_text() == page()


if __name__ == "__main__":
    PAGE.write_text(page())
