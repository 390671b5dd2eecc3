"""`rover-twin reproduce`: the paper's experiment on the shipped runs, its numbers beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli import options
from service.cli.failures import UsageError
from service.cli.output import make_table, note, print_answer, titled
from service.cli.store_access import open_store

if TYPE_CHECKING:
    from service.training.reproduce import Reproduction

_PAGE_FILE = "README.md"
_TITLE = "# The paper's experiment, repeated"
_CAPTIONS = {
    "figure_2_positions": "Where the rear wheel is at twelve times, at the unseen 28° slope (the paper's figure 2).",
    "figure_3_distance": "Distance along the slope against time, same run (the paper's figure 3).",
    "error_against_time": "Distance between predicted and simulated position against time, same run. Stars: the final "
    "errors that the paper states.",
    "figure_4_double_mass": "As the first figure for twice the mass and torque, without retraining (the paper's "
    "figure 4).",
}


def reproduce(
    output: Annotated[
        Path, typer.Option(metavar="DIRECTORY", help="Where the page and the figures go; made where missing.")
    ] = Path("docs/reproduction"),
    seeds: Annotated[int, typer.Option(min=1, max=100, help="How often to train what is random.")] = 3,
    quick: Annotated[
        bool, typer.Option("--quick", help="Hardly train: tries the command, says nothing about accuracy.")
    ] = False,
    threads: Annotated[
        int | None, typer.Option(help="Processor threads. Default: as many as the CPU quota allows.")
    ] = None,
    store: options.Store = None,
) -> None:
    """Repeat the experiment of the paper on the shipped Chrono runs and print its results beside ours.

    Trains every model without the runs at 28 degrees, asks it for them, and draws the paper's four figures. Takes
    minutes. Progress goes to stderr, the table to stdout; page and figures are written at the end.

    Examples:
    The page that is in the repository:
      rover-twin reproduce

    A glance at what it does:
      rover-twin reproduce --quick --output /tmp/reproduction
    """
    from service.cli.threads import use_threads
    from service.cli.views.training_progress import make_progress
    from service.training.drawing import RENDERERS
    from service.training.figures import reproduction_figures
    from service.training.reproduce import COLUMNS, Effort, table
    from service.training.reproduce import reproduce as run

    _refuse_to_replace_another_page(output)
    use_threads(threads)
    with make_progress() as progress:
        effort = Effort.of(seeds, quick=quick)
        result = run(open_store(store), effort, announce=progress.phase, show_epoch=progress.epoch)
        progress.phase("drawing")
    drawn = reproduction_figures(result)
    files = {f"{name}.{kind}": render(figure) for name, figure in drawn.items() for kind, render in RENDERERS.items()}
    cells = table(result)
    _write(output, files | {_PAGE_FILE: _page(result, COLUMNS, cells, quick).encode()})
    answer = make_table(*COLUMNS, left=2)
    for row in cells:
        answer.add_row(*row)
    print_answer(titled("the paper's experiment on our runs, position errors", answer))
    note(f"wrote {len(files) + 1} files to {output}")


def _refuse_to_replace_another_page(folder: Path) -> None:
    page = folder / _PAGE_FILE
    if page.exists() and not page.read_text(encoding="utf-8", errors="replace").startswith(_TITLE):
        raise UsageError(f"--output {folder}: {page} is not a page of this command; give another directory")


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def _page(result: Reproduction, columns: Sequence[str], cells: Sequence[Sequence[str]], quick: bool) -> str:
    """The Markdown page: command, table, figures, and how each number is made."""
    from service.training.provenance import library_versions

    effort, course, libraries = result.effort, result.course, library_versions()
    options = "--quick" if quick else f"--seeds {effort.seeds}"
    warning = "**Made with `--quick`: these errors say nothing about accuracy.**\n\n" if quick else ""
    lines = [f"| {' | '.join(row)} |" for row in (columns, ["---"] * 2 + ["---:"] * (len(columns) - 2), *cells)]
    figures = "\n\n".join(f"![{text}]({name}.svg)\n*{text}*" for name, text in _CAPTIONS.items())
    return _PAGE.format(
        title=_TITLE,
        options=options,
        warning=warning,
        table="\n".join(lines),
        figures=figures,
        train=len(course.train),
        space=len(course.space),
        samples=f"{len(course.unseen.time_s):,}",
        horizon=f"{course.unseen.horizon_s:g}",
        seeds=effort.seeds,
        epochs=effort.fit.epochs,
        rows=f"{effort.fit.rows_per_epoch:,}",
        datasets=", ".join(f"{record.name} `{record.id[:12]}`" for record in course.data.records),
        libraries=", ".join(f"{name} {libraries[name]}" for name in ("torch", "numpy")),
    )


_PAGE = """{title}

The experiment of IAC-23-A3.IP.204, sections 4.1 and 4.2, on the Chrono runs shipped here. This page and its figures are
written by

```sh
rover-twin reproduce {options}
```

{warning}{table}

Where training is random, cells are medians over seeds, with the range in parentheses.

{figures}

## How each number is made

- **Runs.** Datasets `paper` (430 kg, 60 N m), `mass` (twice both) and `space` of the shipped store: Project Chrono on
  lunar regolith, rear wheel, {samples} samples over {horizon} s. The paper used other runs, so its rows are for
  orientation: only the rows above them compare like with like. Made from {datasets}, with {libraries}; the same
  datasets, libraries and kind of processor give the same errors again.
- **28° final and maximum.** Distance between predicted and simulated wheel centre after {horizon} s, and its maximum
  over the run, at 28°, 430 kg and 60 N m. Trained on the other {train} slopes of dataset `paper`; no part of the run
  at 28° is used for calibration, scaling, fitting or stopping.
- **860 kg final and maximum.** The same models, not retrained, at 28°, 860 kg and 120 N m. Rows trained on the `space`
  set also saw its {space} runs (other slopes, masses and torques), still neither the run at 28° nor any of `mass`.
- **Every 4th point.** Root of the paper's loss, equation (4), over every fourth sample of the {train} training runs.
  This is how the paper validates. The model was trained on the neighbours of each sample, 0.5 ms away. So the column
  measures memory and not prediction; judge by the columns before it.
- **One trajectory.** Median time of 15 predictions of 20,001 points on one thread, on the machine that wrote
  this page. No other column depends on the machine. The paper's 120 ms are from a graphics card.
- **Printed prior.** Equations (1) and (2) exactly as printed, with the friction coefficient that fits the training
  slopes best, because the paper states none. **Motor prior**: the closed form of a motor whose torque falls with speed.
  Its one coefficient is fitted the same way.
- **Paper's network.** Five dense layers (30, 120, 500, 50, 2), ReLU, of time and slope, loss of equation (4);
  {seeds} seed(s), {epochs} epochs of {rows} samples drawn from the training runs. The figures show the seed with the
  median final error, over the printed prior.
- **Our model.** An equation of motion whose states are what the rover did to the ground: ruts, slip and digging, with
  motors and traction of two axles. Its numbers are fitted to whole runs. Nothing in it is random. What is likely before
  a fit is in the code, chosen once on all shipped runs. So the run at 28° had a part in that choice, but none in the
  fit. The model learns from every sample: its entry under "every 4th point" is an error on training samples. The
  figures show the row without the space set.
- **The paper's rows.** Section 4: 1.9 m and 6.1 cm at 28°, 120 ms; section 4.2 calls the errors at 860 kg "pretty
  similar". The paper states no values for empty cells. Its abstract has other numbers (60 m reduced to 20 cm, 400 ms)
  without an experiment that gives them.
"""
