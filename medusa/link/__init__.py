"""A device's serial line: frame, port, session."""

from medusa.link.line import Line
from medusa.link.messages import Event, Hello, Statistics
from medusa.link.operation import Operation
from medusa.link.session import Session
from medusa.link.trace import Trace

__all__ = ["Event", "Hello", "Line", "Operation", "Session", "Statistics", "Trace"]
