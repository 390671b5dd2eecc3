"""`rover-twin jobs`: training jobs that a worker carries out, on the very queue that the service uses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer

from service.cli import options
from service.cli.output import note, print_answer, print_json
from service.cli.store_access import open_store
from service.training.config import ArchitectureName, InputName, PriorName, XForm

if TYPE_CHECKING:
    from service.jobs.job import TrainingJob
    from service.jobs.queue import JobQueue

app = typer.Typer(
    name="jobs",
    help="Start training jobs, watch and cancel them. A `rover-twin worker`, or the one beside `serve`, does the work.",
    no_args_is_help=True,
)

_SPLIT = "Which runs are kept for testing"
_FITTING = "How to fit"
_AFTERWARDS = "What becomes of the version"
_QUEUE = "Where and how"

JobId = Annotated[str, typer.Argument(metavar="ID", help="Id of the job, as `jobs start` and `jobs list` print it.")]
State = Literal["queued", "running", "succeeded", "failed", "cancelled"]


@app.command("start")
def start_job(
    model: Annotated[str, typer.Option(help="Name of the model that gets a new version: a-z, 0-9 and -.")],
    datasets: options.Datasets,
    prior: Annotated[
        PriorName | None, typer.Option(help="Closed-form part. Default: motor_slope.", show_default=False)
    ] = None,
    architecture: Annotated[
        ArchitectureName | None,
        typer.Option(help="Learned part; zero is the prior alone. Default: drive_model.", show_default=False),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            help=f"What a network sees, time_s first: {', '.join(get_args(InputName))}. Repeatable. Default: all.",
            show_default=False,
        ),
    ] = None,
    x_form: Annotated[
        XForm | None,
        typer.Option(
            help="A network's x output: the correction, as in the paper, or the correction per time. "
            "Default: mean_speed.",
            show_default=False,
        ),
    ] = None,
    test_slopes_deg: Annotated[
        list[float] | None,
        typer.Option(
            "--test-slope-deg",
            help="Keep every run at this slope for testing. Repeatable.",
            rich_help_panel=_SPLIT,
            show_default=False,
        ),
    ] = None,
    test_fraction: Annotated[
        float | None,
        typer.Option(
            help="Share of the other runs kept for testing, at random; 0 to 0.9. Default: 0.0.",
            rich_help_panel=_SPLIT,
            show_default=False,
        ),
    ] = None,
    description: Annotated[
        str | None, typer.Option(help="A sentence for people, kept in the manifest.", show_default=False)
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help="The same seed gives the same weights. Default: 1.", rich_help_panel=_FITTING, show_default=False
        ),
    ] = None,
    epochs: Annotated[
        int | None,
        typer.Option(help="At most this many. Default: 200.", rich_help_panel=_FITTING, show_default=False),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            help="At most this many minutes of fitting; the best epoch until then counts. Default: 60.0.",
            rich_help_panel=_FITTING,
            show_default=False,
        ),
    ] = None,
    promote: Annotated[
        Literal["never", "if_better"] | None,
        typer.Option(
            help="Point champion to the version when its error on unseen runs is better by the margin. Default: never.",
            rich_help_panel=_AFTERWARDS,
            show_default=False,
        ),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(
            help="Share by which the error on unseen runs must fall; 0 to 0.5. Default: 0.05.",
            rich_help_panel=_AFTERWARDS,
            show_default=False,
        ),
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Stay and follow the job until it ends.", rich_help_panel=_QUEUE)
    ] = False,
    key: Annotated[
        str | None,
        typer.Option(
            metavar="KEY",
            help="Makes the command safe to repeat: the same key and options answer the same job.",
            rich_help_panel=_QUEUE,
            show_default=False,
        ),
    ] = None,
    actor: options.Actor = None,
    store: options.Store = None,
    database: options.Database = None,
    json: options.Json = False,
) -> None:
    """Queue a training job and print its id. What cannot work is refused before anything is queued.

    The version gets the alias candidate; champion moves only with --promote if_better. Options that are not given have
    the defaults that they have over HTTP.

    Examples:
    Train on two datasets, follow the job, and serve the new version if it is better:
      rover-twin jobs start --model viper-lunar --dataset paper --dataset mass --promote if_better --watch

    Leave the job to the worker and look later:
      rover-twin jobs start --model my-rover --dataset my-runs --key monday
      rover-twin jobs list
    """
    from service.cli.actions.job_requests import request_of
    from service.jobs.submission import submit

    request = request_of(
        {
            "model": model,
            "datasets": datasets,
            "prior": prior,
            "architecture": architecture,
            "inputs": inputs,
            "x_form": x_form,
            "split": {"test_slopes_deg": test_slopes_deg, "test_fraction": test_fraction},
            "description": description,
            "seed": seed,
            "budget": {"max_epochs": epochs, "max_minutes": minutes},
            "promote": promote,
            "margin": margin,
        }
    )
    with _queue(store, database) as queue:
        job, created = submit(open_store(store), queue, request, actor=options.actor_name(actor), key=key)
        if not created:
            note(f"job {job.id} was started with this key before")
        if watch:
            _follow(queue, job.id, json)
        elif json:
            print_json(job.model_dump(mode="json"))
        else:
            print(job.id)


@app.command("list")
def list_jobs(
    state: Annotated[State | None, typer.Option(help="Only jobs in this state.", show_default=False)] = None,
    model: Annotated[str | None, typer.Option(help="Only jobs for this model.", show_default=False)] = None,
    limit: Annotated[int, typer.Option(min=1, max=1000, help="At most this many; 1 to 1000.")] = 50,
    store: options.Store = None,
    database: options.Database = None,
    json: options.Json = False,
) -> None:
    """List training jobs, newest first.

    Examples:
      rover-twin jobs list
      rover-twin jobs list --state running --json
    """
    from service.cli.views.jobs import jobs_table

    with _queue(store, database) as queue:
        jobs = queue.list(state=state, model=model, limit=limit)
    if json:
        print_json({"jobs": [job.model_dump(mode="json") for job in jobs]})
    else:
        print_answer(jobs_table(jobs))


@app.command("show")
def show_job(
    job: JobId, store: options.Store = None, database: options.Database = None, json: options.Json = False
) -> None:
    """Show one job: what was asked, where it stands, and the version or the failure that came out.

    Example:
      rover-twin jobs show 0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10
    """
    with _queue(store, database) as queue:
        _show(queue.get(job), json)


@app.command("watch")
def watch_job(
    job: JobId, store: options.Store = None, database: options.Database = None, json: options.Json = False
) -> None:
    """Follow a job until it ends: progress on stderr, the result on stdout. Ctrl-C leaves the job alone.

    Exit code 1 when the job failed, 4 when it was cancelled.

    Example:
      rover-twin jobs watch 0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10
    """
    with _queue(store, database) as queue:
        _follow(queue, job, json)


@app.command("cancel")
def cancel_job(
    job: JobId, store: options.Store = None, database: options.Database = None, json: options.Json = False
) -> None:
    """Cancel a job that waits or runs; it stops within seconds and publishes nothing.

    Exit code 4 when it has ended already.

    Example:
      rover-twin jobs cancel 0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10
    """
    with _queue(store, database) as queue:
        cancelled = queue.cancel(job)
    if json:
        print_json(cancelled.model_dump(mode="json"))
    else:
        print(f"{cancelled.id} {cancelled.state}")


@app.command("logs")
def show_log(
    job: JobId, store: options.Store = None, database: options.Database = None, json: options.Json = False
) -> None:
    """Print what a job has said so far.

    Example:
      rover-twin jobs logs 0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10
    """
    from service.cli.views.jobs import log_lines

    with _queue(store, database) as queue:
        lines = list(log_lines(queue, job))
    if json:
        print_json({"lines": lines})
        return
    for line in lines:
        print(f"{line['time']} {line['message']}")


@app.command("prune")
def prune_jobs(
    older_than_days: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=36_500,
            help="Only jobs that ended more than N days ago. Default: ROVER_TWIN_KEEP_JOBS_DAYS, else 90.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Count them, and remove none.")] = False,
    store: options.Store = None,
    database: options.Database = None,
    json: options.Json = False,
) -> None:
    """Remove jobs that ended long ago, with their events, logs and keys; at most 10,000 of them. Workers do so hourly.

    Versions stay, with all that they know of the job that made them. Jobs that wait or run are never removed.

    Examples:
      rover-twin jobs prune --older-than-days 30 --dry-run
      rover-twin jobs prune --older-than-days 30
    """
    from service.settings import load_settings

    days = older_than_days or load_settings().keep_jobs_days
    with _queue(store, database) as queue:
        removed = queue.prune(open_store(store), days, dry_run=dry_run)
    if json:
        print_json({"jobs": removed, "older_than_days": days, "dry_run": dry_run})
    else:
        verb = "would be removed" if dry_run else "removed"
        print(f"{removed} jobs that ended more than {days} days ago {verb}")


@contextmanager
def _queue(store: str | None, database: str | None) -> Iterator[JobQueue]:
    """The queue that the settings name. The store is looked at first, so that a wrong one is not made."""
    from service.jobs.queue import JobQueue
    from service.settings import load_settings

    settings = load_settings(store_url=store, jobs_database_url=database)
    open_store(store)
    with closing(JobQueue.open(settings.jobs_url(), settings.max_queued_jobs, settings.keep_jobs_days)) as queue:
        yield queue


def _follow(queue: JobQueue, job_id: str, json: bool) -> None:
    from service.cli.actions.job_watching import raise_unless_succeeded, watch

    job = watch(queue, job_id)
    _show(job, json)
    raise_unless_succeeded(job)


def _show(job: TrainingJob, json: bool) -> None:
    from service.cli.views.jobs import job_facts

    content: dict[str, Any] = job.model_dump(mode="json")
    if json:
        print_json(content)
    else:
        print_answer(job_facts(job))
