"""A bench as a process: served until a signal, with its control channel and its script of incidents."""

import asyncio
import logging
import signal
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

from sim_devices.assembly import BenchConfig, build_parts
from sim_devices.bench import Bench, UnknownVerb
from sim_devices.config import Faults, Incident
from sim_devices.control import ControlServer
from sim_devices.rendered import RenderedWorld
from sim_devices.stream import CameraStream

log = logging.getLogger(__name__)


async def serve(
    config: BenchConfig, faults: Faults, links: Path, seed: int | None, *, announce: Callable[[str], None]
) -> None:
    """Serve until SIGINT or SIGTERM; announce a line for each port and then "ready"."""
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    bench = Bench(build_parts(config, seed), seed=seed, baud=config.baud, faults=faults.line, links=links)
    check_script(bench, faults)
    async with ControlServer(bench, links), bench, AsyncExitStack() as streams:
        timers = [loop.call_later(incident.time_s, _happen, bench, incident) for incident in faults.at]
        for name, path in bench.ports.items():
            announce(f"{name} {path}")
        for world in bench.parts.values():
            if isinstance(world, RenderedWorld):
                for name, camera in world.cameras.items():
                    stream = CameraStream(camera, world.ports[name])
                    announce(f"camera-{name} {(await streams.enter_async_context(stream)).url}")
                world.start()
                streams.callback(world.stop)
        announce("ready")
        await ended.wait()
        for timer in timers:
            timer.cancel()


def check_script(bench: Bench, faults: Faults) -> None:
    """Raise ValueError when an incident names no verb of the bench."""
    verbs = bench.verbs()
    for n, incident in enumerate(faults.at):
        if incident.verb not in verbs:
            raise ValueError(
                f"faults: at[{n}].verb = {incident.verb!r}: no such verb; there are {', '.join(sorted(verbs))}"
            )


def _happen(bench: Bench, incident: Incident) -> None:
    try:
        bench.inject(incident.verb, **incident.arguments)
    except (UnknownVerb, ValueError, OSError) as error:
        log.error("incident %s at %g s: %s", incident.verb, incident.time_s, error)
    except Exception:
        log.exception("incident %s at %g s failed", incident.verb, incident.time_s)
