"""medusa-ctl track: find a target with both cameras, jump to it, follow it, keep both eyes on it."""

import asyncio
import json
import math
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.cli.track_eyes import Eyes
    from medusa.gaze.report.track_log import TrackLog
    from medusa.gaze.run.assembly import GazeChoice
    from medusa.gaze.run.loop import GazeLoop
    from medusa.head.joint_group import JointGroup


def register(app: typer.Typer) -> None:
    app.command()(track)


def track(
    context: typer.Context,
    seconds: float = typer.Option(20.0, min=0.5, max=3600.0, help="For how long."),
    controller: str = typer.Option("predictive", help="predictive, or thesis: the PID of 6.5."),
    gains: str = typer.Option("iv", help="Column of table 6.4, for the thesis's controller."),
    vergence: str = typer.Option(
        "targets", help="targets: both eyes detect; disparity: the right correlates."
    ),
    coordination: str = typer.Option("i", help="i eyes first, ii neck follows, iii shared (6.5.3)."),
    rate: float = typer.Option(6.0, min=0.5, max=200.0, help="Pictures a second."),
    left: str = typer.Option("", metavar="CAMERA", help="Device, by-id name, file, folder or address."),
    right: str = typer.Option("", metavar="CAMERA", help="The right eye's."),
    cameras: str = typer.Option(
        "", metavar="FILE", help="Intrinsics [left], [right] and [head], by calibrate."
    ),
    threshold: int = typer.Option(200, min=0, max=254, help="Grey level that a bright target exceeds."),
    least_area: float = typer.Option(0.0, min=0.0, help="Gate by area, square pixels; 0: no gate."),
    roundness: float = typer.Option(0.0, min=0.0, max=1.0, help="Gate by shape: 1 only filled ellipses."),
    patch: str = typer.Option(
        "", metavar="FILE", help="Follow this textured patch instead of a bright spot."
    ),
    screen: str = typer.Option("", metavar="DIR", help="With --sim: real pictures on a swinging screen."),
    target: str = typer.Option("lamp", help="With --sim: lamp or texture."),
    pixels: int = typer.Option(64, min=16, max=1024, help="With --sim: width and height of the pictures."),
    latency: float = typer.Option(60.0, min=0.0, max=2000.0, help="With --sim: of a picture, ms."),
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where figure and table go.")] = Path("out/track"),
    video: str = typer.Option("", metavar="FILE", help="Save both eyes' annotated pictures: .avi or .mp4."),
) -> None:
    """Find a target with both eyes, jump to it, follow it, keep both eyes on it; then a table and a figure."""
    options: Options = context.obj
    settings = {
        "threshold": threshold, "least_area": least_area, "roundness": roundness, "patch": patch,
        "screen": screen, "target": target, "pixels": pixels, "latency": latency, "rate": rate,
        "left": left, "right": right, "cameras": cameras, "vergence": vergence,
    }  # fmt: skip

    async def body() -> "tuple[TrackLog, dict[str, Any]]":
        from medusa.cli.track_eyes import real_eyes, simulated_eyes, simulated_world
        from medusa.errors import CommandError
        from medusa.gaze.run.assembly import GazeChoice

        if vergence not in ("targets", "disparity"):
            raise CommandError(f"there is no vergence from {vergence!r}; there is targets, disparity")
        choice = GazeChoice(rate, controller, gains, coordination)
        world = simulated_world(settings) if options.sim else None
        async with AsyncExitStack() as stack:
            head, simulated = await stack.enter_async_context(options.head(homed=True, world=world))
            opened = simulated_eyes(simulated, settings) if simulated is not None else real_eyes(settings)
            eyes = await stack.enter_async_context(opened)
            log, document = await _follow(options, head, eyes, choice, seconds, video)
        return log, document

    _make_folder(options, out)
    log, document = options.run(body)
    _leave(options, log, document, out)
    options.show(document, lambda: print_table("gaze, degrees and milliseconds", _rows(document)))
    options.progress("left behind: " + ", ".join(document["files"]))


def _make_folder(options: Options, out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        options.fail(f"{out}: {error.strerror}", 4)


def _leave(options: Options, log: "TrackLog", document: dict[str, Any], out: Path) -> None:
    from medusa.gaze.report.track_figure import draw_track

    try:
        (out / "track.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        draw_track(log, out / "track.png", start=document["start"])
    except OSError as error:
        options.fail(f"{error.filename or out}: {error.strerror}", 4)
    document["files"] += [str(out / "track.json"), str(out / "track.png")]


async def _follow(
    options: Options, head: "JointGroup", eyes: "Eyes", choice: "GazeChoice", seconds: float, video: str
) -> "tuple[TrackLog, dict[str, Any]]":
    from medusa.gaze.report.video import GazeVideo
    from medusa.gaze.run.loop import GazeLoop

    loop = asyncio.get_running_loop()
    async with AsyncExitStack() as stack:
        recorder = None
        if video:
            recorder = GazeVideo(Path(video), eyes.intrinsics, choice.frame_rate, start=loop.time())
            stack.callback(recorder.close)
        gaze_loop = GazeLoop(
            head, eyes.cameras, eyes.retina(), choice.make_gaze(head.traits, eyes.geometry),
            choice.loop_settings(head.traits, eyes.geometry), listener=recorder,
        )  # fmt: skip
        start = loop.time()
        progress = loop.create_task(_report(options, gaze_loop, start), name="report progress")
        stack.callback(progress.cancel)
        options.progress(
            f"tracking for {seconds:g} s: {choice.controller}, coordination ({choice.coordination})"
        )
        log = await gaze_loop.run(seconds)
        camera_counts = {camera.name: vars(camera.statistics) for camera in eyes.cameras}
    summary = log.summary(since=start + min(2.0, seconds / 4.0))
    document = {
        **summary,
        "start": start,
        "seconds": round(loop.time() - start, 3),
        "controller": choice.controller,
        "coordination": choice.coordination,
        "holds": [reason for _, reason in log.holds][-3:],
        "cameras": camera_counts,
        "files": [video] if video else [],
    }
    return log, document


async def _report(options: Options, gaze_loop: "GazeLoop", start: float) -> None:
    """A line of progress every two seconds."""
    loop = asyncio.get_running_loop()
    while True:
        await asyncio.sleep(2.0)
        rows = [row for row in gaze_loop.log.rows if row.stamp > loop.time() - 2.0]
        errors = [math.degrees(gaze_loop.log.retinal_error(row)) for row in rows]
        seen = [error for error in errors if not math.isnan(error)]
        worst = f"worst error {max(seen):5.2f}°" if seen else "target not seen"
        jumps = len(gaze_loop.log.saccades)
        options.progress(
            f"{loop.time() - start:6.1f} s  {len(seen):3d} of {len(rows):3d} pictures  {worst}  {jumps} saccades"
        )


def _rows(document: dict[str, Any]) -> list[dict[str, Any]]:
    labels = {
        "rms_error_deg": "RMS error [°]", "median_error_deg": "median error [°]", "peak_error_deg": "peak error [°]",
        "median_vergence_error_deg": "median vergence error [°]", "median_latency_ms": "latency [ms]",
        "saccades": "saccades", "pictures": "pictures", "seen": "with the target",
        "blind_frames": "exposed in saccades", "late_frames": "too late",
    }  # fmt: skip
    rows = [
        {"figure": label, "value": "–" if (value := document[key]) is None else f"{value:.3g}"}
        for key, label in labels.items()
    ]
    if document["limited"]:
        rows.append({"figure": "held at an end of travel", "value": ", ".join(document["limited"])})
    return rows
