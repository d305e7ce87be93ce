"""The operations of the toy device in conftest.py."""

from medusa.link import Operation

SET = Operation(0x30, "SET", reply=None)
READ = Operation(0x31, "READ", reply=None, reads=True)
ADD = Operation(0x32, "ADD", reply=None)
STOP = Operation(0x33, "STOP", reply=None, stops=True, urgent=True)
RAISE_EVENT = Operation(0x34, "RAISE_EVENT", reply=None)
MOVE = Operation(0x35, "MOVE", reply=None, axis="one", moves=True)
