"""One direction of a serial line: every frame arrives when its last byte has passed at the line's rate."""

from collections import deque

from sim_devices.link.faults import Carried, FaultyWire


class Wire:
    """Frames that wait for the instant at which their last byte has passed, in order."""

    def __init__(self, byte_time: float) -> None:
        self.queue: deque[tuple[float, bytes]] = deque()
        self.waiting_bytes = 0
        self.free = 0.0
        self.faults: FaultyWire | None = None
        self._byte_time = byte_time

    def put(self, data: bytes, t: float, up_since: float) -> Carried | None:
        """Send data from t on, or from when the wire is free."""
        if self.faults is None:
            self._queue(data, max(t, self.free))
            return None
        carried = self.faults.carry(data, t - up_since)
        start = max(t, self.free) + carried.stall_s
        for pause, piece in carried.pieces:
            self._queue(b"" if carried.lost else piece, start + pause, len(piece))
            start = self.free
        return carried

    def _queue(self, data: bytes, start: float, length: int | None = None) -> None:
        self.free = start + (len(data) if length is None else length) * self._byte_time
        self.queue.append((self.free, data))
        self.waiting_bytes += len(data)

    def take(self) -> bytes:
        """Remove the first frame and return it; b"" when it was lost."""
        data = self.queue.popleft()[1]
        self.waiting_bytes -= len(data)
        return data

    def clear(self) -> None:
        """Lose what is on the wire."""
        self.queue.clear()
        self.waiting_bytes = 0
