"""A command line of its own: options anywhere, one line for what is wrong, signals that stop once, true exit codes."""

import asyncio
import json
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pytest
import typer

from medusa.console import Console, make_app, run_program
from medusa.console.program import globals_first
from medusa.console.signals import cancelled_by_signals
from medusa.errors import CommandError

Run = Callable[..., tuple[int, str, str]]


@dataclass(frozen=True, kw_only=True)
class Cart(Console):
    program: ClassVar[str] = "cart-ctl"
    machine: ClassVar[str] = "cart"

    def run_virtual(self, main: Coroutine[Any, Any, Any]) -> Any:
        raise AssertionError("no --sim here")


async def handled() -> None:
    """Until the loop has read a signal from its pipe, and called its handler."""
    for _ in range(3):
        await asyncio.sleep(0)


async def roll() -> None:
    """Rolls until a signal; the stop takes its time, in which the signal comes again."""
    number = signal.Signals(int(os.environ["SIGNAL"]))
    signal.raise_signal(number)
    try:
        await asyncio.Event().wait()
    except asyncio.CancelledError as ended:
        signal.raise_signal(number)
        await handled()
        if note := os.environ.get("NOTE"):
            ended.add_note(note)
        raise


app = make_app(Cart.program, Cart.machine)


@app.callback()
def _options(
    context: typer.Context,
    json: bool = typer.Option(False, "--json"),
    trace: str = typer.Option(""),
    seed: int = typer.Option(0),
) -> None:
    context.obj = Cart(json=json, trace=trace or None, seed=seed)


@app.command(context_settings={"ignore_unknown_options": True})
def go(context: typer.Context, distance: float) -> None:
    console: Cart = context.obj

    async def body() -> None:
        if distance > 10:
            raise CommandError(f"{distance:g} m is outside 0..10 m")
        if distance > 5:
            logging.getLogger("cart").warning("slipping", exc_info=ZeroDivisionError("wheel"))
            logging.getLogger("cart").warning("slipping")
        if distance < 0:
            await roll()

    console.run(body)
    console.show({"went": distance, "seed": console.seed}, lambda: print("went" * 100_000))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cart-ctl", *arguments])
        with pytest.raises(SystemExit) as ended:
            run_program(app, Cart.program)
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    return call


def test_the_options_of_every_command_are_moved_before_it() -> None:
    typed = ["go", "-1", "--json", "--seed", "3", "--trace=t", "--", "--json"]
    moved = globals_first(typed, {"--json"}, {"--seed", "--trace"})
    assert moved == ["--json", "--seed", "3", "--trace=t", "go", "-1", "--", "--json"]


def test_options_may_follow_the_command(run: Run) -> None:
    code, out, _ = run("go", "3", "--json", "--seed=4")
    assert (code, json.loads(out)) == (0, {"went": 3.0, "seed": 4})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nonsense"], r"No such command 'nonsense'; see cart-ctl --help"),
        (["go", "far"], r"Invalid value for 'distance': .*; see cart-ctl --help"),
        (["--fast", "go", "1"], r"No such option.*--fast.*; see cart-ctl --help"),
        (["go", "11"], r"11 m is outside 0\.\.10 m"),
    ],
)
def test_what_is_wrong_is_one_line_and_with_json_a_document(
    run: Run, arguments: list[str], message: str
) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert re.fullmatch(f"cart-ctl: {message}\n", err, re.IGNORECASE), err
    code, out, err = run("--json", *arguments)
    assert (code, err) == (2, f"cart-ctl: {json.loads(out)['error']}\n")
    assert json.loads(out)["exit_code"] == 2


def test_without_a_command_the_help_is_shown_once(run: Run) -> None:
    code, out, err = run()
    assert (code, err, out.count("Usage:")) == (2, "", 1)
    assert "129, 130 and 143 interrupted and stopped" in " ".join(out.split())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_cancels_once_and_each_further_one_only_says_so(
    run: Run, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    monkeypatch.setenv("SIGNAL", str(int(number)))
    code, out, err = run("go", "-1")
    assert (code, out) == (128 + number, "")
    assert err.splitlines() == [
        "cart-ctl: still stopping the cart",
        f"cart-ctl: stopped by {number.name}; the cart is at rest",
    ]


def test_a_stop_that_is_not_confirmed_is_not_called_one(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIGNAL", str(int(signal.SIGTERM)))
    monkeypatch.setenv("NOTE", "the left wheel does not answer")
    code, _, err = run("go", "-1")
    assert code == 6
    assert err.splitlines()[-1] == "cart-ctl: interrupted by SIGTERM; the left wheel does not answer"


def test_a_hang_up_that_nohup_ignores_stays_ignored() -> None:
    caught: list[signal.Signals] = []

    async def body() -> str:
        signal.raise_signal(signal.SIGHUP)
        await handled()
        return "done"

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert asyncio.run(cancelled_by_signals(body, caught, "")) == "done"
    finally:
        signal.signal(signal.SIGHUP, before)
    assert caught == []


ROOT = Path(__file__).parents[3]
PROGRAM = "from tests.medusa.console.test_program import *\nrun_program(app, Cart.program)"


def start(*arguments: str, **more: Any) -> "subprocess.Popen[str]":
    return subprocess.Popen([sys.executable, "-c", PROGRAM, *arguments], text=True, cwd=ROOT, **more)


# A long output fails when it is printed, a short one at the end.
LONG, SHORT = ("go", "1"), ("go", "1", "--json")


@pytest.mark.parametrize("arguments", [LONG, SHORT])
def test_a_reader_that_has_gone_ends_it_quietly(arguments: tuple[str, ...]) -> None:
    read, write = os.pipe()
    os.close(read)
    piped = start(*arguments, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert piped.communicate(timeout=60)[1] == ""
    assert piped.returncode == 1


@pytest.mark.parametrize("arguments", [LONG, SHORT])
def test_a_full_disk_under_the_output_is_one_line(arguments: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:
        written = start(*arguments, stdout=full, stderr=subprocess.PIPE)
    assert written.communicate(timeout=60)[1] == "cart-ctl: output: No space left on device\n"
    assert written.returncode == 4


def test_a_warning_is_logged_once_and_without_a_traceback() -> None:
    slipping = start("go", "6", "--json", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert slipping.communicate(timeout=60)[1] == "WARNING slipping: wheel\n"
    assert slipping.returncode == 0
