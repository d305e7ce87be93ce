"""The emergency stop of somebody who knows no more than a port: sent before any handshake, to whoever receives."""

import logging

from medusa.errors import NoReply
from medusa.link import Line
from medusa.mc3000.config import Mc3000Config

log = logging.getLogger(__name__)


async def send_emergency_stop(path: str, config: Mc3000Config | None) -> None:
    """Broadcast it, then send it to each address of the configuration; a board that cannot answer may still receive.

    Raises PortError. That somebody did not confirm it is logged, not raised.
    """
    baud = 115200 if config is None else config.ports.baud
    async with Line(path, baud=baud) as line:
        for address in () if config is None else config.board_addresses:
            line.session(address)
        try:
            await line.emergency_stop()
        except NoReply as error:
            log.warning("%s", error)
