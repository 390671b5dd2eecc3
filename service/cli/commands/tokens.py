"""`rover-twin tokens`: who may use a service, by name."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from service.cli import options
from service.cli.failures import ExitCode, UsageError
from service.cli.output import make_table, note, print_answer, print_json

app = typer.Typer(name="tokens", help="Who may use a service: tokens by name.", no_args_is_help=True)


class TokenScope(StrEnum):
    """What a token allows."""

    READ = "read"
    ADMIN = "admin"


File = Annotated[
    Path | None,
    typer.Option(
        "--file",
        metavar="PATH",
        help="The file of tokens. Default: ROVER_TWIN_TOKENS_FILE.",
        show_default=False,
    ),
]
Name = Annotated[str, typer.Argument(metavar="NAME", help="Who gets it: a person or a program.")]


@app.command("create")
def create(
    name: Name,
    scope: Annotated[
        TokenScope, typer.Option("--scope", help="read: look at everything but the audit log. admin: everything.")
    ],
    file: File = None,
    json: options.Json = False,
) -> None:
    """Make a token and print it, this once: the file keeps only its SHA-256.

    A running service takes it within a second or two. Give it to NAME over a way that nobody else reads.

    Examples:
      rover-twin tokens create ada --scope admin --file tokens
      ROVER_TWIN_TOKENS_FILE=tokens rover-twin serve
    """
    from service.access.token_file import StoredToken, add
    from service.access.tokens import digest_of, new_token

    place = _place(file)
    token = new_token()
    add(place, StoredToken(name, scope.value, digest_of(token.encode())))
    if json:
        print_json({"name": name, "scope": scope.value, "token": token})
        return
    print(token)
    note(f"{name} may {'do everything' if scope is TokenScope.ADMIN else 'read'}; this token is not shown again")


@app.command("list")
def list_tokens(file: File = None, json: options.Json = False) -> None:
    """List names and scopes. No token can be read from the file.

    Example:
      rover-twin tokens list --file tokens
    """
    from service.access.token_file import stored

    found = stored(_place(file))
    if json:
        print_json({"tokens": [{"name": each.name, "scope": each.scope} for each in found]})
        return
    table = make_table("name", "scope", left=2)
    for each in found:
        table.add_row(each.name, each.scope)
    print_answer(table)


@app.command("revoke")
def revoke(name: Name, file: File = None) -> None:
    """Take a token out of the file. A running service refuses it within a second or two.

    Example:
      rover-twin tokens revoke ada --file tokens
    """
    from service.access.token_file import remove

    if not remove(_place(file), name):
        note(f"error: there is no token named {name[:100]!r}")
        raise typer.Exit(ExitCode.NOT_FOUND)
    print(f"{name} has no token any more")


def _place(file: Path | None) -> Path:
    """Raises UsageError when nobody says which file."""
    from service.settings import load_settings

    place = file or load_settings().tokens_file
    if place is None:
        raise UsageError("say which file of tokens: --file PATH, or ROVER_TWIN_TOKENS_FILE")
    return place
