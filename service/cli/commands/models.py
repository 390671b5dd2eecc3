"""`rover-twin models`: versions and aliases in the store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.cli import options
from service.cli.answer_forms import chosen_form, write_content
from service.cli.failures import ExitCode, RefusedError
from service.cli.output import make_table, note, print_answer, print_json
from service.cli.store_access import check_names, open_store

if TYPE_CHECKING:
    from model_store import AliasRecord, ModelStore

FormatName = Literal["table", "json", "svg", "png", "html"]
app = typer.Typer(
    name="models",
    help="Look at models, their versions and aliases; move aliases, take versions out of use.",
    no_args_is_help=True,
)

Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the model.")]
Alias = Annotated[str, typer.Argument(metavar="ALIAS", help="Name of the alias, such as champion.")]
Number = Annotated[int, typer.Argument(metavar="VERSION", help="Number of the version.")]
IfAt = Annotated[
    int | None,
    typer.Option(
        metavar="SEQ",
        min=0,
        help="Only if this is still its last move (`seq` in `models history`; 0: none yet); else exit code 4.",
        show_default=False,
    ),
]


@app.command("list")
def list_models(store: options.Store = None, json: options.Json = False) -> None:
    """List every model with its versions and what its aliases mean.

    Example:
      rover-twin models list --store my-store
    """
    from service.cli.views.models import list_all

    models, unreadable = list_all(open_store(store))
    if json:
        shown = ("name", "versions", "archived", "deleted", "aliases")
        print_json({"models": [{key: each[key] for key in shown} for each in models]})
    else:
        table = make_table("name", "versions", "aliases", "description", left=4)
        for each in models:
            aliases = ", ".join(f"{alias}={version}" for alias, version in each["aliases"].items())
            versions = ", ".join(map(str, each["versions"])) or "none in use"
            table.add_row(each["name"], versions, aliases or "-", each["description"])
        print_answer(table)
    for reason in unreadable:
        note(f"error: {reason}")
    if unreadable:
        raise typer.Exit(ExitCode.FAILED)


@app.command("show")
def show_version(
    reference: Annotated[
        str,
        typer.Argument(
            metavar="NAME[@VERSION|@ALIAS]", help="A bare name means its champion, else its newest version."
        ),
    ],
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Show one version: what it is, where it holds (domain), how good it is, and what it was made from.

    Examples:
      rover-twin models show viper-lunar
      rover-twin models show viper-lunar@1 --json
    """
    from service.cli.views.models import dataset_names, describe, find_version

    opened = open_store(store)
    manifest = find_version(opened, reference)
    if json:
        print_json(manifest.model_dump(mode="json"))
        return
    state, record = opened.version_state(manifest.name, manifest.version)
    if record is not None:
        note(f"{state} by {record.actor}: {record.reason or 'no reason given'}")
    for part in describe(manifest, dataset_names(opened, manifest)):
        print_answer(part)


@app.command("compare")
def compare_two(
    candidate: Annotated[str, typer.Argument(metavar="A", help="NAME[@VERSION|@ALIAS] to be judged.")],
    against: Annotated[
        str | None, typer.Argument(metavar="[B]", help="What to judge it beside. Default: the champion of its model.")
    ] = None,
    margin: Annotated[
        float | None, typer.Option(help="How much smaller A's errors must be, as a share, 0 to 0.5. Default: 0.05.")
    ] = None,
    form: Annotated[
        FormatName,
        typer.Option("--format", help="A verdict in text, or what the API answers: numbers, a picture or a page."),
    ] = "table",
    output: options.Output = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Say whether A is better than B, on runs that neither has seen: the gate that training jobs pass.

    The exit code is 0 whatever the verdict; --json has it as "verdict" and "promote". --format json, svg, png and html
    add errors by regime, the domains and positions on a few slopes.

    Examples:
      rover-twin models compare my-rover@candidate
      rover-twin models compare viper-lunar@2 viper-lunar@1 --json
      rover-twin models compare viper-lunar@5 viper-lunar@1 --format html --output comparison.html
    """
    from service.cli.views.model_comparison import compare_references, describe_comparison

    chosen = chosen_form(form, json, output)
    if form != "table":
        from service.cli.actions.version_pages import comparison

        write_content(comparison(open_store(store), candidate, against, margin, chosen), chosen, output)
        return
    compared = compare_references(open_store(store), candidate, against, margin)
    if json:
        print_json(compared.describe())
        return
    for part in describe_comparison(compared):
        print_answer(part)


@app.command("card")
def show_card(
    reference: Annotated[
        str,
        typer.Argument(
            metavar="NAME[@VERSION|@ALIAS]", help="A bare name means its champion, else its newest version."
        ),
    ],
    form: Annotated[
        Literal["json", "svg", "png", "html"], typer.Option("--format", help="Numbers, a picture or a page.")
    ] = "html",
    output: options.Output = None,
    store: options.Store = None,
) -> None:
    """Write the card of a version: lineage, errors on runs it has not seen, domain, where it must not be used.

    Examples:
      rover-twin models card viper-lunar --output card.html
      rover-twin models card viper-lunar@5 --format svg --output card.svg
    """
    from service.cli.actions.version_pages import card

    chosen = chosen_form(form, False, output)
    write_content(card(open_store(store), reference, chosen), chosen, output)


@app.command("verify")
def verify_versions(
    reference: Annotated[
        str | None,
        typer.Argument(metavar="[NAME[@VERSION|@ALIAS]]", help="Only this version. Default: all versions."),
    ] = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Read every file of a version, or of all versions, and compare it with the digest in its manifest.

    Exit code 1 when anything is damaged; everything else is still checked.

    Examples:
      rover-twin models verify
      rover-twin models verify viper-lunar@1
    """
    from service.cli.views.models import verify

    verdicts = verify(open_store(store), reference)
    if json:
        print_json({"versions": [{"version": version, "damage": damage} for version, damage in verdicts]})
    for version, damage in verdicts:
        if damage is not None:
            note(f"error: {version}: {damage}")
        elif not json:
            print(f"{version} whole")
    if any(damage is not None for _, damage in verdicts):
        raise typer.Exit(ExitCode.FAILED)


@app.command("export-fmu")
def export_fmu(
    reference: Annotated[
        str,
        typer.Argument(
            metavar="NAME[@VERSION|@ALIAS]", help="A bare name means its champion, else its newest version."
        ),
    ],
    output: Annotated[Path, typer.Option(metavar="FILE", help="Where to write it, such as viper.fmu.")],
    fmi: Annotated[Literal["2.0", "3.0"], typer.Option(help="Version of the FMI standard.")] = "2.0",
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Write a version as an FMU for co-simulation: a rover that runs inside other simulators, without this program.

    Only versions with the drive model can be exported. docs/fmu.md says how simulators load it.

    Examples:
      rover-twin models export-fmu viper-lunar --output viper.fmu
      rover-twin models export-fmu viper-lunar@5 --fmi 3.0 --output viper.fmu
    """
    from service.cli.actions.fmu_export import write_fmu

    written = write_fmu(open_store(store), reference, fmi, output)
    if json:
        print_json({"version": written.version, "fmi": fmi, "file": str(output), "bytes": written.size})
    else:
        print(f"{written.version} as FMI {fmi} in {output}: {written.size} bytes")


@app.command("alias")
def move_alias(
    name: Name,
    alias: Alias,
    version: Annotated[int, typer.Argument(metavar="VERSION", help="Number of a published version.")],
    reason: options.Reason,
    if_at: IfAt = None,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Point an alias, new or not, to a version. Services that follow it change over within seconds.

    The version's files are verified first. The move is kept in the alias's history, with who and why.

    Examples:
      rover-twin models alias my-rover champion 2 --reason "half the error on the test runs"

    Only if nobody has moved it since `models history` showed 3 as its last move:
      rover-twin models alias my-rover champion 2 --reason "half the error" --if-at 3
    """
    check_names(name, alias)
    opened = open_store(store)
    opened.verify(name, version)
    with _unless_overtaken(if_at):
        moved = opened.move_alias(
            name, alias, version, actor=options.actor_name(actor), reason=reason, expected_seq=if_at
        )
    _show_record(name, alias, moved, json)


@app.command("rollback")
def roll_back(
    name: Name,
    alias: Alias,
    reason: options.Reason,
    if_at: IfAt = None,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Take the last move of an alias back; like undo, a second rollback goes one version further back.

    Example:
      rover-twin models rollback my-rover champion --reason "slides where the rover climbed"
    """
    opened = open_store(store)
    with _unless_overtaken(if_at):
        record = opened.rollback(name, alias, actor=options.actor_name(actor), reason=reason, expected_seq=if_at)
    _show_record(name, alias, record, json)


@app.command("history")
def show_history(name: Name, alias: Alias, store: options.Store = None, json: options.Json = False) -> None:
    """Show every move of an alias, newest first: when, by whom and why.

    Example:
      rover-twin models history viper-lunar champion
    """
    records = open_store(store).alias_history(name, alias)[::-1]
    if json:
        print_json({"history": [record.model_dump(mode="json") for record in records]})
        return
    table = make_table("seq", "version", "time", "actor", "reason", left=5)
    for record in records:
        time = record.time.isoformat(timespec="seconds")
        table.add_row(str(record.seq), str(record.version), time, record.actor, record.reason)
    print_answer(table)


@app.command("archive")
def archive_version(
    name: Name,
    version: Number,
    reason: options.Reason,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Take a version out of use; everything of it is kept. Refused (exit code 4) while an alias names it.

    Services that have it in memory drop it within seconds.

    Example:
      rover-twin models archive my-rover 2 --reason "slides where the rover climbed"
    """
    from service.cli.actions.version_states import retire

    retire(open_store(store), "archived", name, version, actor=options.actor_name(actor), reason=reason)
    _show_state(open_store(store), name, version, json)


@app.command("restore")
def restore_version(
    name: Name,
    version: Number,
    reason: options.Reason,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Bring an archived version back into use. One that was deleted stays so (exit code 4).

    Example:
      rover-twin models restore my-rover 2 --reason "it was the soil"
    """
    opened = open_store(store)
    opened.restore_version(name, version, actor=options.actor_name(actor), reason=reason)
    _show_state(opened, name, version, json)


@app.command("delete")
def delete_version(
    name: Name,
    version: Number,
    reason: options.Reason,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Remove a version's weights for good. Refused (exit code 4) while an alias names it.

    Its number is never used again, and its manifest and report stay: `models show` still says what it was made from.

    Example:
      rover-twin models delete my-rover 2 --reason "trained on the wrong soil"
    """
    from service.cli.actions.version_states import retire

    retire(open_store(store), "deleted", name, version, actor=options.actor_name(actor), reason=reason)
    _show_state(open_store(store), name, version, json)


def _show_state(store: ModelStore, name: str, version: int, json: bool) -> None:
    from service.cli.actions.version_states import describe_state

    state = describe_state(store, name, version)
    if json:
        print_json(state)
    else:
        print(f"{name}@{version} is {state['state']}")


@contextmanager
def _unless_overtaken(if_at: int | None) -> Iterator[None]:
    """Whoever says where an alias must be gets a refusal when it is elsewhere."""
    from model_store import ConflictError

    try:
        yield
    except ConflictError as error:
        if if_at is None:
            raise
        raise RefusedError(str(error)) from error


def _show_record(name: str, alias: str, record: AliasRecord, json: bool) -> None:
    if json:
        print_json(record.model_dump(mode="json"))
    else:
        print(f"{name}@{alias} now means version {record.version}")
