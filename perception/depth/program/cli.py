"""depth-from-motion: an image sequence and the camera's motion in, depth maps out."""

import json as documents
import math
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import typer

if TYPE_CHECKING:
    from perception.depth.program.run import RunOptions, TableRow

app = typer.Typer(
    name="depth-from-motion",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _above_zero(value: float | None) -> float | None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value}, a number above 0 is needed")
    return value


@app.command(
    epilog=(
        "Exit codes: 0 done, 2 wrong arguments, images or motion, 3 camera, setting, reference or output folder,"
        " 130 and 143 interrupted. An estimate that fails or is interrupted leaves the output folder as it was."
    )
)
def estimate(
    sequence: Path = typer.Argument(
        help="A folder of images, a pattern like 'views/*.ppm', or a .txt file that lists them."
    ),
    out: Path = typer.Option(help="Folder for maps, pictures, cloud.ply and table.csv."),
    camera: Path | None = typer.Option(
        None,
        help="TOML with fx, fy, cx, cy in pixels, distortion if there is any.",
        show_default="camera.toml beside the images, or a 60° lens",
    ),
    motion: Path | None = typer.Option(
        None,
        help="Steps in CSV (tx ty tz m, wx wy wz rad), TUM or KITTI poses.",
        show_default="motion.csv, groundtruth.txt or poses.txt beside the images",
    ),
    motion_format: str = typer.Option(
        "auto", metavar="auto|csv|tum|kitti", help="How the motion file is written."
    ),
    preset: str = typer.Option(
        "default", help="default, thesis (chapter 2 to the letter) or thesis-unequalised."
    ),
    near: float | None = typer.Option(None, help="Nearest depth searched, m.", show_default="0.1"),
    far: float | None = typer.Option(None, help="Farthest depth searched, m.", show_default="200"),
    start_depth: float | None = typer.Option(
        None, callback=_above_zero, help="First guess of the thesis preset, m.", show_default="12"
    ),
    order: str | None = typer.Option(None, metavar="1,2,5,4,3", help="The images to use, in this order."),
    reference_frame: int | None = typer.Option(
        None,
        min=1,
        help="Keep this image and its view for the map.",
        show_default="the newest view",
    ),
    reference: Path | None = typer.Option(
        None, help="Ground truth of the map's view: depth (m) or disparity, 0 unknown."
    ),
    reference_scale: float = typer.Option(
        1.0, callback=_above_zero, help="The reference's value of one metre or one pixel."
    ),
    reference_baseline: float | None = typer.Option(
        None,
        callback=_above_zero,
        help="The reference holds disparities of this baseline, m.",
        show_default="it holds depths",
    ),
    json: bool = typer.Option(False, "--json", help="One JSON document on stdout, all else on stderr."),
) -> None:
    """Estimate depth with its standard deviation, image by image, from a moving camera."""
    from dataclasses import replace

    from perception.depth.errors import DepthError, OptionError
    from perception.depth.files.output_folder import fill_whole
    from perception.depth.program.run import RunOptions, make_plan

    try:
        numbers = None if order is None else tuple(int(number) for number in order.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"{order!r} is no list of numbers like 1,2,5,4,3", param_hint="--order"
        ) from None
    options = RunOptions(
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
        count = len(make_plan(options).motions)
        with fill_whole(out) as stage:
            try:
                rows = _run(replace(options, out=stage), count)
            except OptionError as error:
                # The user knows the folder by its own name, not by that of the stage.
                raise OptionError(str(error).replace(str(stage), str(out))) from error
    except OptionError as error:
        _fail(str(error), 3, json)
    except DepthError as error:
        _fail(str(error), 2, json)
    except OSError as error:
        _fail(f"{error.filename or out}: {error.strerror or error}", 3, json)
    if json:
        typer.echo(documents.dumps(_document(rows, out), ensure_ascii=False, indent=2, allow_nan=False))
    else:
        _print(rows, out)


def _run(options: "RunOptions", count: int) -> list["TableRow"]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from perception.depth.program.run import run

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    rows: list[TableRow] = []
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("depth", total=count)
        for row in run(
            options, lambda text: console.print(text, style="yellow", highlight=False, soft_wrap=True)
        ):
            rows.append(row)
            if row.remark:
                console.print(f"{row.picture}: {row.remark}", style="yellow", highlight=False, soft_wrap=True)
            progress.update(task, advance=1, description=row.picture)
    return rows


def _print(rows: list["TableRow"], out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(
        "image", "step m", "turn °", "residual px", "confirmed", "known", "depth m", "σ/depth", "ms"
    )
    judged = any(row.accuracy for row in rows)
    if judged:
        for name in ("median err", "< 25 %", "bad 1", "bad 2", "in 68 %", "in 95 %"):
            table.add_column(name)
    for row in rows:
        cells = [
            row.picture,
            f"{row.baseline_m:.3f}",
            f"{row.rotation_deg:.2f}",
            f"{row.stray_px:.1f}" if row.stray_px else "–",
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


def _document(rows: list["TableRow"], out: Path) -> dict[str, Any]:
    from dataclasses import asdict

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(part) for key, part in value.items()}
        # JSON has no NaN: what is unknown is null.
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return {"out": str(out), "pictures": [plain(asdict(row)) for row in rows]}


def _fail(text: str, code: int, json: bool) -> NoReturn:
    message = " ".join(text.split())
    typer.echo(f"depth-from-motion: {message}", err=True)
    if json:
        typer.echo(documents.dumps({"error": message, "exit_code": code}, ensure_ascii=False))
    raise typer.Exit(code)


def _terminated(number: int, frame: FrameType | None) -> NoReturn:
    # An exception, so that what is half-written goes.
    sys.exit(128 + number)


def main() -> None:
    """Run the command line; what the parser finds wrong is one line, too."""
    signal.signal(signal.SIGTERM, _terminated)
    usage_error: type[Exception] = typer.BadParameter.__mro__[1]
    try:
        code = app(prog_name="depth-from-motion", standalone_mode=False)
        sys.stdout.flush()
    except usage_error as error:
        message = " ".join(getattr(error, "format_message", error.__str__)().split()).rstrip(".")
        print(f"depth-from-motion: {message}; see depth-from-motion --help", file=sys.stderr)
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        print("depth-from-motion: interrupted; nothing was written", file=sys.stderr)
        code = 130
    except BrokenPipeError:
        # The reader of our output has closed it.
        sys.stderr.close()
        code = 1
    except OSError as error:
        print(f"depth-from-motion: the output cannot be written ({error.strerror})", file=sys.stderr)
        # What is still buffered could not be written either.
        sys.stdout = None
        code = 3
    sys.exit(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
