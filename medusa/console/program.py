"""A command line as a program: its parser, and its end with an exit code, whatever was typed."""

import os
import signal
import sys
from collections.abc import Collection, Sequence
from typing import NoReturn

import typer

from medusa.console import exit_codes
from medusa.console.output import print_error


def make_app(program: str, machine: str) -> typer.Typer:
    """An empty command line, its exit codes under its help."""
    return typer.Typer(
        name=program,
        add_completion=False,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        epilog=exit_codes.epilog(machine),
    )


def run_program(app: typer.Typer, program: str) -> NoReturn:
    """Run the command line on this process's arguments and exit; what the parser finds wrong is one line, too."""
    command = typer.main.get_command(app)
    flags = {name for option in command.params if getattr(option, "is_flag", False) for name in option.opts}
    values = {name for option in command.params for name in option.opts} - flags
    arguments = globals_first(sys.argv[1:], flags, values)
    as_json = "--json" in arguments
    # typer brings its own copy of click and exports of its errors only BadParameter: the usage error is what that is.
    usage_error: type[Exception] = typer.BadParameter.__mro__[1]
    try:
        result = command.main(args=arguments, prog_name=program, standalone_mode=False)
        code = result if isinstance(result, int) else exit_codes.DONE
    except usage_error as error:
        code = exit_codes.USAGE
        message = " ".join(getattr(error, "format_message", error.__str__)().split()).rstrip(".")
        # Without any argument the help has just been shown.
        if message:
            print_error(program, f"{message}; see {program} --help", code, as_json=as_json)
    except (typer.Abort, KeyboardInterrupt):
        code = exit_codes.SIGNAL + signal.SIGINT
    except OSError as error:
        code = _unwritable(program, error)
    sys.exit(_flushed(program, code))


def globals_first(arguments: Sequence[str], flags: Collection[str], values: Collection[str]) -> list[str]:
    """The arguments with the options of every command (`flags`, and `values` that take one) before the command."""
    front: list[str] = []
    rest: list[str] = []
    words = iter(arguments)
    for word in words:
        if word == "--":
            rest += [word, *words]
        elif word in flags or (word.split("=")[0] in values and "=" in word):
            front.append(word)
        elif word in values:
            front += [word, *([value] if (value := next(words, None)) is not None else [])]
        else:
            rest.append(word)
    return front + rest


def _flushed(program: str, code: int) -> int:
    """The exit code once stdout is written, or cannot be; an error before that keeps its own."""
    try:
        sys.stdout.flush()
    except OSError as error:
        # Else Python itself would complain at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return code or _unwritable(program, error)
    return code


def _unwritable(program: str, error: OSError) -> int:
    if isinstance(error, BrokenPipeError):
        # Whoever read the output has gone.
        return exit_codes.UNPRINTABLE
    message = f"{error.filename or 'output'}: {error.strerror or error}"
    print_error(program, message, exit_codes.PORT, as_json=False)
    return exit_codes.PORT
