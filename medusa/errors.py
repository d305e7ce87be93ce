"""What can go wrong, and where it came from (`origin`)."""

from typing import Any, ClassVar, Literal

Origin = Literal["caller", "port", "line", "device", "configuration", "unknown"]

STATUS_NAMES = {
    0: "ok",
    1: "unknown operation",
    2: "bad axis",
    3: "bad length",
    4: "out of range",
    5: "bad register",
    6: "wrong mode",
    7: "profile running",
    8: "limit or fault latched",
    9: "emergency stop latched",
    10: "no HELLO since power-up",
    11: "busy",
}


class MedusaError(Exception):
    """Root of every error that the drivers raise on purpose; its text is one line."""

    origin: ClassVar[Origin] = "unknown"


class PortError(MedusaError):
    """The port cannot be opened, or vanished in use; `may_have_acted` when a request was under way."""

    origin: ClassVar[Origin] = "port"

    def __init__(self, path: str, reason: str, *, may_have_acted: bool = False) -> None:
        self.path = path
        self.reason = reason
        self.may_have_acted = may_have_acted
        super().__init__(f"{path}: {reason}" + (" (the request may have acted)" if may_have_acted else ""))


class ProtocolError(MedusaError):
    """The device sent something that its protocol page does not allow; `frame` holds the bytes."""

    origin: ClassVar[Origin] = "device"

    def __init__(self, message: str, *, frame: bytes = b"") -> None:
        self.frame = frame
        super().__init__(message + (f" [{frame.hex(' ')}]" if frame else ""))


class NoReply(ProtocolError):
    """A request ended unanswered; `may_have_acted` is False only when none of its bytes left the host."""

    origin: ClassVar[Origin] = "line"

    def __init__(self, message: str, *, frame: bytes = b"", may_have_acted: bool = True) -> None:
        self.may_have_acted = may_have_acted
        acted = "it may have acted" if may_have_acted else "it did not act"
        super().__init__(f"{message}; {acted}", frame=frame)


class Withdrawn(NoReply):
    """A motion command gave way to a later stop, clear or HELLO and is not repeated again."""

    origin: ClassVar[Origin] = "caller"


class DeviceSilent(NoReply):
    """Nothing answered for a second: the device gets only EMERGENCY_STOP and HELLO until it answers one."""

    origin: ClassVar[Origin] = "device"


class CommandError(MedusaError):
    """You asked for something that cannot be done; nothing moved. `status` is the device's answer, if any."""

    origin: ClassVar[Origin] = "caller"

    def __init__(
        self,
        message: str,
        *,
        status: int | None = None,
        operation: int | None = None,
        axis: int | None = None,
    ) -> None:
        self.status = status
        self.operation = operation
        self.axis = axis
        super().__init__(message)


class DeviceFault(MedusaError):
    """The machine stopped, or its state is unknown; `axis` is the one concerned (None: all)."""

    origin: ClassVar[Origin] = "device"

    def __init__(self, message: str, *, axis: str | int | None = None) -> None:
        self.axis = axis
        super().__init__(message)


class DeviceRestarted(DeviceFault):
    """The device lost its state: homing, pose and mode are invalid."""

    def __init__(self, message: str, *, before: int | None = None, now: int | None = None) -> None:
        self.before = before
        self.now = now
        super().__init__(message)


class HostGap(DeviceFault):
    """Nothing fed the device for longer than its watchdog (s): the machine has stopped, and motion is over."""

    def __init__(self, device: str, gap: float, watchdog: float) -> None:
        self.device = device
        self.gap = gap
        self.watchdog = watchdog
        super().__init__(
            f"{device} was not fed for {gap:.2f} s: its watchdog of {1e3 * watchdog:.0f} ms stops it"
        )


class ConfigError(MedusaError):
    """A configuration file is wrong: which file, which key, its value and what is allowed."""

    origin: ClassVar[Origin] = "configuration"

    def __init__(self, file: str, key: str, value: Any, allowed: str) -> None:
        self.file = file
        self.key = key
        self.value = value
        self.allowed = allowed
        super().__init__(f"{file}: {key} = {value!r}: {allowed}" if key else f"{file}: {allowed}")
