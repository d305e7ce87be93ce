"""The front of a command line: its options, clock, signals, exit codes, JSON documents and tables."""

from medusa.console.command import Console
from medusa.console.program import make_app, run_program
from medusa.console.tables import make_table, print_table

__all__ = ["Console", "make_app", "make_table", "print_table", "run_program"]
