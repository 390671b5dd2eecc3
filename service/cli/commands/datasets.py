"""`rover-twin datasets`: Chrono runs in and out of the store."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli import options
from service.cli.actions.dataset_findings import tell_findings
from service.cli.commands.dataset_preview import preview_dataset
from service.cli.failures import ExitCode, RefusedError, UsageError
from service.cli.output import make_table, note, print_answer, print_json
from service.cli.recording_options import FrameWord, ReferenceWord, StartWord
from service.cli.store_access import open_store
from service.cli.views.file_progress import file_progress

if TYPE_CHECKING:
    from rich.table import Table

    from service.datasets import Finding

app = typer.Typer(
    name="datasets",
    help="Look at datasets of Chrono runs; upload files, validate, import and export folders, delete.",
    no_args_is_help=True,
)

Folder = Annotated[
    Path,
    typer.Argument(metavar="FOLDER", help="Folder with passport.json, runs.csv and the files that runs.csv lists."),
]
Sets = Annotated[
    list[str] | None, typer.Option("--set", help="Only the runs of this set of runs.csv. Repeatable. Default: all.")
]
Strict = Annotated[bool, typer.Option("--strict", help="Refuse the whole folder when any run is unusable.")]
Columns = Annotated[
    str | None,
    typer.Option(
        "--column-map",
        metavar="JSON|PRESET",
        help="Which column is which, where headers do not say: a preset for what a program of Chrono writes "
        "(docs/training.md lists them; without a header: vehicle-python, chrono-single-wheel, "
        "chrono-viper-sph-position, chrono-cosim-rover, chrono-cosim-wheel) or JSON such as "
        '{"time_s": 0, "rear_x_m": 1, "rear_y_m": 3, "zero_start": true} with header names or 0-based indices.',
    ),
]

SlopeOption = Annotated[float | None, typer.Option("--slope-deg", help="Slope, where the file does not say it.")]
MassOption = Annotated[
    float | None, typer.Option("--mass-kg", help="Mass of the rover, where the file does not say it.")
]
TorqueOption = Annotated[
    float | None, typer.Option("--torque-nm", help="Stall torque per wheel, where the file does not say.")
]
HorizonOption = Annotated[float | None, typer.Option("--horizon-s", help="How long the run was meant to last.")]
PassportOption = Annotated[
    Path | None,
    typer.Option("--passport", help="A passport.json that says what was simulated; wins over one in the file."),
]


@app.command("list")
def list_datasets(store: options.Store = None, json: options.Json = False) -> None:
    """List every dataset in the store.

    Example:
      rover-twin datasets list --store my-store
    """
    from service.cli.views.datasets import datasets_table

    opened = open_store(store)
    records = [opened.dataset(identity) for identity in opened.dataset_ids()]
    if json:
        others = opened.other_dataset_names()
        names = {record.id: [record.name, *others.get(record.id, ())] for record in records}
        print_json({"datasets": [{**record.model_dump(mode="json"), "names": names[record.id]} for record in records]})
    else:
        print_answer(datasets_table(records))


@app.command("show")
def show_dataset(dataset: options.DatasetId, store: options.Store = None, json: options.Json = False) -> None:
    """Show one dataset: ranges of slope, mass, torque and time, its sets and columns, where it came from.

    Examples:
      rover-twin datasets show paper
      rover-twin datasets show 3fa81c --json
    """
    from service.cli.views.datasets import dataset_facts

    opened = open_store(store)
    record = opened.dataset(dataset)
    names = opened.dataset_names(record)
    if json:
        print_json(record.model_dump(mode="json") | {"names": names})
    else:
        print_answer(dataset_facts(record, names))


@app.command("validate")
def validate_runs(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH",
            help="Folder with runs.csv, passport.json and the files that runs.csv lists, or a file as for `upload`.",
        ),
    ],
    sets: Sets = None,
    column_map: Columns = None,
    frame: FrameWord = None,
    reference: ReferenceWord = None,
    start: StartWord = None,
    slope_deg: SlopeOption = None,
    mass_kg: MassOption = None,
    torque_nm: TorqueOption = None,
    horizon_s: HorizonOption = None,
    passport: PassportOption = None,
    json: options.Json = False,
) -> None:
    """Read a folder or a file of Chrono runs and say, file by file, what can be used and why the rest cannot.

    Nothing is stored. A file gets the report of an upload's dry run. Exit code 4 when any run is unusable.

    Examples:
      rover-twin datasets validate my-runs
      rover-twin datasets validate my-runs --frame world --start 2.0
      rover-twin datasets validate one.csv --slope-deg 20 --mass-kg 430 --torque-nm 60
      rover-twin datasets validate my-runs.zip --json
    """
    from service.cli.actions.dataset_validation import validate
    from service.datasets.alignment import Alignment

    Alignment.said(frame=frame, reference=reference, start=start)  # refuses what is no such word
    scenario = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm, "horizon_s": horizon_s}
    recorded = {"frame": frame, "reference": reference, "start": start}
    fields = {"column_map": read_column_map(column_map), "passport": passport, **scenario, **recorded}
    with file_progress("reading") as progress:
        report = validate(path, fields, sets, progress)
    if json:
        print_json(report.as_json())
    else:
        print_answer(_findings_table(report.findings))
        print(f"{len(report.accepted)} runs usable, {len(report.rejected)} not")
    if report.rejections:
        raise typer.Exit(ExitCode.REFUSED)


@app.command("import")
def import_runs(
    folder: Folder,
    name: Annotated[str, typer.Option(help="Name for people: letters, digits, . _ and -.")],
    sets: Sets = None,
    strict: Strict = False,
    column_map: Columns = None,
    frame: FrameWord = None,
    reference: ReferenceWord = None,
    start: StartWord = None,
    step_s: Annotated[
        float | None,
        typer.Option(
            "--step-s",
            help="Keep at most one row per so many seconds, the last one, and those where torque or brake change. "
            "Default: every row.",
        ),
    ] = None,
    description: Annotated[str, typer.Option(help="A sentence for people, kept with the dataset.")] = "",
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Validate a folder of Chrono runs and store what is usable as a dataset.

    Its id is a digest of passport and runs: the same runs are the same dataset, however often they are imported.
    Unusable runs are rejected, with their reasons on stderr. With --strict they stop the import (exit code 4).

    Examples:
      rover-twin datasets import my-runs --name my-runs
      rover-twin datasets import my-runs --name steep --set space --strict --store my-store
      rover-twin datasets import my-runs --name stall --set stall --step-s 0.005
    """
    from service.datasets import RejectedDatasetError
    from service.datasets.alignment import Alignment
    from service.training.dataset_import import import_folder

    mapping = read_column_map(column_map)
    said = Alignment.said(frame=frame, reference=reference, start=start)
    if folder.is_file():
        raise UsageError(f"{folder} is a file; store it by `rover-twin datasets upload`")
    try:
        with file_progress("reading") as progress:
            record, report = import_folder(
                open_store(store, create=True),
                folder,
                name=name,
                created_by=options.actor_name(actor),
                description=description,
                sets=sets,
                strict=strict,
                column_map=mapping,
                said=said,
                step_s=step_s,
                progress=progress,
            )
    except RejectedDatasetError as error:
        raise RefusedError(f"{error} (`rover-twin datasets validate {folder}` lists all reasons)") from error
    tell_findings(report.findings)
    if json:
        print_json({"dataset": record.model_dump(mode="json"), "report": report.as_json()})
        return
    also = f", stored before as {record.name}" if record.name != name else ""
    print(f"dataset {record.id} ({name}{also}): {len(report.accepted)} runs, {len(report.rejected)} rejected")


@app.command("upload")
def upload_file(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A zip or tar with runs.csv and passport.json, a table with scenario columns (CSV or Parquet), or one "
            "file of Chrono; each also packed by gzip, bzip2 or xz. Slope, torque and brake may change by row.",
        ),
    ],
    name: Annotated[str | None, typer.Option(help="Name for people; without it, from the file's name.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Read and validate, store nothing.")] = False,
    slope_deg: SlopeOption = None,
    mass_kg: MassOption = None,
    torque_nm: TorqueOption = None,
    horizon_s: HorizonOption = None,
    set_name: Annotated[str | None, typer.Option("--set", help="Set of the runs that name none.")] = None,
    passport: PassportOption = None,
    strict: Strict = False,
    column_map: Columns = None,
    frame: FrameWord = None,
    reference: ReferenceWord = None,
    start: StartWord = None,
    description: Annotated[str, typer.Option(help="A sentence for people, kept with the dataset.")] = "",
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Store a file of Chrono runs as a dataset, as an upload to the service does.

    Its id is a digest of passport and runs: the same runs are the same dataset, in whatever kind of file they come.

    Examples:
      rover-twin datasets upload my-runs.zip --name my-runs
      rover-twin datasets upload my-runs.zip --dry-run
      rover-twin datasets upload one.dat --slope-deg 20 --mass-kg 430 --torque-nm 60 --column-map vehicle-python
      rover-twin datasets upload settled.zip --start 2.0 --reference front-wheel --dry-run
    """
    from service.cli.actions.dataset_upload import Upload, upload
    from service.datasets.alignment import Alignment

    fields = {"name": name, "set_name": set_name, "column_map": read_column_map(column_map), "passport": passport}
    scenario = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm, "horizon_s": horizon_s}
    Alignment.said(frame=frame, reference=reference, start=start)  # refuses what is no such word
    fields |= {"frame": frame, "reference": reference, "start": start}
    told = Upload(file, {**fields, **scenario, "strict": strict, "description": description}, dry_run)
    with file_progress("reading") as progress:
        result = upload(told, open_store(store, create=not dry_run), options.actor_name(actor), progress)
    tell_findings(result.report.findings)
    if json:
        print_json(
            {
                "id": result.dataset_id,
                "created": result.created,
                "dry_run": dry_run,
                "already_known_as": list(result.already_known_as),
                "dataset": result.record.model_dump(mode="json") if result.record else None,
                "report": result.report.as_json(),
            }
        )
        return
    runs = f"{len(result.report.accepted)} runs, {len(result.report.rejected)} rejected"
    known = f", stored before as {', '.join(result.already_known_as)}" if result.already_known_as else ""
    print(f"dataset {result.dataset_id}{known}: {runs}{', nothing stored' if dry_run else ''}")


@app.command("delete")
def delete_dataset(
    dataset: options.DatasetId,
    store: options.Store = None,
    database: options.Database = None,
    json: options.Json = False,
) -> None:
    """Delete a dataset. Refused (exit code 4) while a model version was trained on it or an unfinished job names it.

    Example:
      rover-twin datasets delete my-runs --store my-store
    """
    from service.cli.actions.dataset_deletion import delete_unused
    from service.settings import load_settings

    settings = load_settings(store_url=store, jobs_database_url=database)
    opened = open_store(store)
    record = opened.dataset(dataset)
    delete_unused(opened, record, settings.jobs_url(), settings.max_queued_jobs)
    if json:
        print_json({"deleted": record.id})
    else:
        print(f"deleted dataset {record.id} ({record.name})")


@app.command("forget-name")
def forget_name(
    dataset: Annotated[str, typer.Argument(metavar="ID", help="Whole id of the dataset.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="The name that is to find it no more.")],
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Take a name from a dataset. The one that it was stored under stays as long as the dataset.

    Example:
      rover-twin datasets forget-name 0f3a... my-runs --store my-store
    """
    open_store(store).forget_dataset_name(dataset, name)
    if json:
        print_json({"dataset": dataset, "forgot": name})
    else:
        print(f"dataset {dataset} is no longer found by the name {name}")


@app.command("export")
def export_dataset(
    dataset: options.DatasetId,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder to make; it must not exist yet.")],
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Write a dataset as a folder of text files: passport.json, runs.csv and runs/*.csv.gz.

    `rover-twin datasets import` reads the folder back to the very same dataset: that is checked before the folder
    appears.

    Example, then train on your own copy of the runs:
      rover-twin datasets export paper my-runs
      rover-twin datasets import my-runs --name my-runs --store my-store
    """
    from service.cli.actions.dataset_export import export_folder

    opened = open_store(store)
    record = opened.dataset(dataset)
    with file_progress("writing") as progress:
        exported = export_folder(opened, record.id, folder, progress)
    if json:
        print_json({"id": record.id, "folder": str(folder), "runs": exported.runs, "column_map": exported.column_map})
        return
    print(f"wrote {exported.runs} runs of dataset {record.id} to {folder}")
    if exported.column_map:
        note(f"import it with --column-map {exported.column_map}: its passport has a column map for other files")


def read_column_map(text: str | None) -> str | Mapping[str, str | int] | None:
    """A preset's name, or JSON. Raises UsageError for text that is neither."""
    if text is None or not text.lstrip().startswith("{"):
        return text
    try:
        mapping = json_text.loads(text)
    except ValueError as error:
        raise UsageError(f"--column-map is not JSON: {error}") from error
    return dict(mapping)


def _findings_table(findings: tuple[Finding, ...]) -> Table:
    table = make_table("severity", "file", "line", "column", "code", "what", left=6)
    for each in findings:
        row = "" if each.row is None else str(each.row)
        table.add_row(str(each.severity), each.file, row, each.column or "", str(each.code), each.message)
    return table


app.command("preview")(preview_dataset)
