"""medusa-ctl calibrate: the cameras' lenses, and with --head baseline, optical centres and turns."""

import math
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from medusa.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.calibration.head_geometry import HeadCalibration
    from perception.camera.calibration import BoardView, CalibrationBoard, IntrinsicsCalibration


def register(app: typer.Typer) -> None:
    app.command()(calibrate)


def calibrate(
    context: typer.Context,
    head: bool = typer.Option(
        False, "--head", help="Move the joints before a board at rest; find the geometry, too."
    ),
    left: str = typer.Option("", metavar="CAMERA", help="Device, by-id name, file, folder or address."),
    right: str = typer.Option("", metavar="CAMERA", help="The right eye's."),
    out: Path = typer.Option(Path("cameras.toml"), metavar="FILE", help="Where the calibration is written."),
    columns: int = typer.Option(8, min=3, help="Squares of the ChArUco board across."),
    rows: int = typer.Option(6, min=3, help="Squares down."),
    square: float = typer.Option(40.0, min=1.0, help="Side of a square, mm."),
    marker: float = typer.Option(30.0, min=1.0, help="Side of a marker, mm."),
    dictionary: str = typer.Option("DICT_4X4_100", help="OpenCV's marker dictionary."),
    draw: str = typer.Option("", metavar="FILE", help="Only write the board as a picture to print."),
    views: int = typer.Option(16, min=6, max=200, help="How many."),
    seconds: float = typer.Option(120.0, min=1.0, help="How long to wait for views by hand, each eye."),
    turn: float = typer.Option(
        8.0, min=1.0, max=30.0, help="With --head: pan, tilt and eyes move by ± this, degrees."
    ),
    rate: float = typer.Option(10.0, min=0.5, help="Pictures a second."),
) -> None:
    """Calibrate both cameras before a ChArUco board, by hand or, with --head, by moving the joints.

    Fails when corners are seen more than 0.3 degrees from where the calibrated head would see them.
    """
    options: Options = context.obj

    async def body() -> dict[str, Any]:
        from medusa.errors import CommandError
        from perception.camera.calibration import CalibrationBoard

        board = CalibrationBoard(columns, rows, square * 1e-3, marker * 1e-3, dictionary)
        if draw:
            return {"board": _draw(board, Path(draw))}
        if options.sim and not head:
            raise CommandError("--sim has nobody to turn the board by hand: use calibrate --head")
        if not options.sim and not (left and right):
            raise CommandError("--left and --right are needed without --sim")
        async with AsyncExitStack() as stack:
            if head:
                return await _by_head(
                    options, stack, board, (left, right), views, math.radians(turn), rate, out
                )
            return await _by_hand(options, stack, board, (left, right), views, seconds, rate, out)

    document = options.run(body)
    options.show(document, lambda: print_table("calibration", _rows(document)))


def _draw(board: "CalibrationBoard", path: Path) -> str:
    import cv2

    from medusa.errors import CommandError

    try:
        written = cv2.imwrite(str(path), board.draw(100))
    except cv2.error as error:
        raise CommandError(f"{path}: {error.err}") from error
    if not written:
        raise CommandError(f"{path}: cannot be written as a picture")
    return str(path)


async def _by_hand(
    options: Options, stack: AsyncExitStack, board: "CalibrationBoard", names: tuple[str, str], count: int,
    seconds: float, rate: float, out: Path,
) -> dict[str, Any]:  # fmt: skip
    from medusa.calibration.board_views import collect_by_hand
    from perception.camera import CaptureSettings, open_camera

    found = {}
    for side, name in zip(("left", "right"), names, strict=True):
        options.progress(f"turn the board before the {side} eye")
        camera = await stack.enter_async_context(open_camera(name, CaptureSettings(rate=rate), name=side))
        views = await collect_by_hand(camera, board, count, seconds, options.progress)
        frame = camera.latest()
        size = (0, 0) if frame is None else frame.size
        found[side] = _lens(views, size)
    _write(out, found, None)
    return _document(found, None, out)


async def _by_head(
    options: Options, stack: AsyncExitStack, board: "CalibrationBoard", names: tuple[str, str], count: int, turn: float,
    rate: float, out: Path,
) -> dict[str, Any]:  # fmt: skip
    from medusa.calibration.board_views import collect_postures, head_views, postures
    from medusa.calibration.head_geometry import estimate_head
    from perception.camera import CaptureSettings, open_camera

    world = None
    if options.sim:
        from medusa.simulation import simulated_board

        world = simulated_board(stack, board.draw(64), board.size, rate)
    head, simulated = await stack.enter_async_context(options.head(homed=True, world=world))
    if simulated is not None:
        cameras = await stack.enter_async_context(simulated.cameras())
    else:
        settings = CaptureSettings(rate=rate)
        cameras = (
            await stack.enter_async_context(open_camera(names[0], settings, name="left")),
            await stack.enter_async_context(open_camera(names[1], settings, name="right")),
        )
    wanted = postures(count, pan=turn, tilt=turn, version=turn, vergence=1.5 * turn)
    seen = await collect_postures(head, cameras, board, wanted, options.progress)
    found = {}
    for side, camera in zip(("left", "right"), cameras, strict=True):
        frame = camera.latest()
        views = [view for posture in seen if (view := getattr(posture, side)) is not None]
        found[side] = _lens(views, (0, 0) if frame is None else frame.size)
    lenses = found["left"].intrinsics, found["right"].intrinsics
    geometry = estimate_head(head_views(seen, lenses))
    _write(out, found, geometry)
    return _document(found, geometry, out)


def _lens(views: "list[BoardView]", size: tuple[int, int]) -> "IntrinsicsCalibration":
    from perception.camera.calibration import estimate_intrinsics

    return estimate_intrinsics(views, *size)


def _write(out: Path, lenses: "dict[str, IntrinsicsCalibration]", geometry: "HeadCalibration | None") -> None:
    from perception.camera.intrinsics import format_intrinsics

    parts = [format_intrinsics(lens.intrinsics, side) for side, lens in lenses.items()]
    if geometry is not None:
        head = geometry.geometry
        lines = [
            "[head]",
            f"baseline_m = {head.baseline!r}",
            f"left_centre_m = {list(head.left_centre)!r}",
            f"right_centre_m = {list(head.right_centre)!r}",
            f"left_turn_rad = {list(geometry.turns['left'])!r}",
            f"right_turn_rad = {list(geometry.turns['right'])!r}",
        ]
        parts.append("\n".join(lines) + "\n")
    out.write_text("\n".join(parts), encoding="utf-8")


def _document(
    lenses: "dict[str, IntrinsicsCalibration]", geometry: "HeadCalibration | None", out: Path
) -> dict[str, Any]:
    document: dict[str, Any] = {"file": str(out)}
    for side, lens in lenses.items():
        document[side] = {
            "focal_px": [lens.intrinsics.fx, lens.intrinsics.fy],
            "principal_point_px": [lens.intrinsics.cx, lens.intrinsics.cy],
            "focal_deviation_px": lens.focal_deviation_px,
            "residual_px": lens.residual_px,
        }
    if geometry is not None:
        document["head"] = {
            "baseline_mm": 1e3 * geometry.geometry.baseline,
            "baseline_deviation_mm": 1e3 * geometry.baseline_deviation,
            "left_centre_mm": [1e3 * v for v in geometry.geometry.left_centre],
            "right_centre_mm": [1e3 * v for v in geometry.geometry.right_centre],
            "centre_deviation_mm": 1e3 * geometry.centre_deviation,
            "left_turn_deg": [math.degrees(v) for v in geometry.turns["left"]],
            "right_turn_deg": [math.degrees(v) for v in geometry.turns["right"]],
            "turn_deviation_deg": math.degrees(geometry.turn_deviation),
            "residual_deg": math.degrees(geometry.residual),
            "worst_view_residual_deg": math.degrees(max(geometry.view_residuals)),
        }
    return document


def _rows(document: dict[str, Any]) -> list[dict[str, Any]]:
    rows = []
    for part, values in document.items():
        if not isinstance(values, dict):
            rows.append({"what": part, "value": str(values)})
            continue
        for key, value in values.items():
            text = ", ".join(f"{v:.2f}" for v in value) if isinstance(value, list) else f"{value:.3f}"
            rows.append({"what": f"{part} {key.replace('_', ' ')}", "value": text})
    return rows
