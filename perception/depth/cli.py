"""depth-from-motion: a picture sequence and the camera's motion in, depth maps out."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from perception.depth.program import Request, Row

app = typer.Typer(
    name="depth-from-motion",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command()
def estimate(
    sequence: Path = typer.Argument(help="A folder of pictures, or a .txt file that lists them."),
    out: Path = typer.Option(help="Folder for maps, pictures, cloud.ply and table.csv."),
    camera: Path | None = typer.Option(
        None,
        help="TOML with fx, fy, cx, cy in pixels.  [default: camera.toml beside the pictures, or a 60° lens]",
    ),
    motion: Path | None = typer.Option(
        None,
        help="Steps in CSV (tx ty tz m, wx wy wz rad), TUM or KITTI poses.  [default: motion.csv, groundtruth.txt or"
        " poses.txt beside the pictures]",
    ),
    motion_format: str = typer.Option(
        "auto", metavar="auto|csv|tum|kitti", help="How the motion file is written."
    ),
    preset: str = typer.Option(
        "default", help="default, thesis (chapter 2 to the letter) or thesis-unequalised."
    ),
    near: float | None = typer.Option(None, help="Nearest depth searched, m.  [default: 0.1]"),
    far: float | None = typer.Option(None, help="Farthest depth searched, m.  [default: 200]"),
    start_depth: float | None = typer.Option(
        None, help="First guess of the thesis preset, m.  [default: 12]"
    ),
    order: str | None = typer.Option(None, metavar="1,2,5,4,3", help="The pictures to use, in this order."),
    reference_frame: int | None = typer.Option(
        None, min=1, help="Keep this picture and let the map stand in its view.  [default: the newest view]"
    ),
    reference: Path | None = typer.Option(
        None, help="Ground truth of the map's view: depth (m) or disparity, 0 unknown."
    ),
    reference_scale: float = typer.Option(1.0, help="The reference's value of one metre or one pixel."),
    reference_baseline: float | None = typer.Option(
        None, help="The reference holds disparities of this baseline, m.  [default: it holds depths]"
    ),
) -> None:
    """Estimate depth with its standard deviation, picture by picture, from a moving camera."""
    from perception.depth.errors import ConfigError, DepthError
    from perception.depth.program import Request, make_plan

    try:
        numbers = None if order is None else tuple(int(number) for number in order.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"{order!r} is no list of numbers like 1,2,5,4,3", param_hint="--order"
        ) from None
    request = Request(
        sequence,
        out,
        camera,
        motion,
        motion_format,
        preset,
        near,
        far,
        start_depth,
        numbers,
        reference_frame,
        reference,
        reference_scale,
        reference_baseline,
    )
    try:
        rows = _run(request, len(make_plan(request).motions))
    except ConfigError as error:
        _fail(str(error), 3)
    except DepthError as error:
        _fail(str(error), 2)
    except OSError as error:
        _fail(f"{error.filename or out}: {error.strerror}", 3)
    _print(rows, out)


def _run(request: "Request", count: int) -> list["Row"]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from perception.depth.program import run

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    rows: list[Row] = []
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("depth", total=count)
        for row in run(request, lambda text: console.print(text, style="yellow", highlight=False)):
            rows.append(row)
            if row.remark:
                console.print(f"{row.picture}: {row.remark}", style="yellow", highlight=False)
            progress.update(task, advance=1, description=row.picture)
    return rows


def _print(rows: list["Row"], out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("picture", "step m", "turn °", "confirmed", "known", "depth m", "σ/depth", "ms")
    judged = any(row.accuracy for row in rows)
    if judged:
        for name in ("median err", "< 25 %", "bad 1", "bad 2", "in 68 %", "in 95 %"):
            table.add_column(name)
    for row in rows:
        cells = [
            row.picture,
            f"{row.baseline_m:.3f}",
            f"{row.rotation_deg:.2f}",
            f"{100 * row.confirmed:.0f} %",
            f"{100 * row.known:.1f} %",
            f"{row.median_depth_m:.3f}",
            f"{100 * row.median_relative_std:.1f} %",
            f"{1e3 * row.seconds:.0f}",
        ]
        if row.accuracy:
            a = row.accuracy
            figures = (a.median_relative, a.within_quarter, a.bad_1, a.bad_2, a.inside_68, a.inside_95)
            cells += ["–" if figure != figure else f"{100 * figure:.2f} %" for figure in figures]
        table.add_row(*cells)
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table)
    console.print(f"maps, pictures, cloud.ply and table.csv are in {out}", highlight=False)


def _fail(text: str, code: int) -> None:
    typer.echo(f"depth-from-motion: {text}", err=True)
    raise typer.Exit(code)


def main() -> None:
    """Run the command line."""
    app()


if __name__ == "__main__":
    main()
