"""What every command of medusa-ctl shares: the options before it, and the head they lead to."""

from collections.abc import AsyncIterator, Collection, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from medusa.console import Console

if TYPE_CHECKING:
    from medusa.head.joint_group import JointGroup
    from medusa.machines import HeadConfig
    from medusa.simulation import SimulatedHead

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Options(Console):
    """The options before the command."""

    program: ClassVar[str] = "medusa-ctl"
    machine: ClassVar[str] = "head"

    boards: str | None = None
    amps: str | None = None
    config: str | None = None

    def run_virtual(self, main: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in virtual time."""
        from medusa.simulation import run_virtual

        return run_virtual(main)

    def head_config(self) -> "HeadConfig | None":
        """The configuration that was asked for; None for the simulated head's own. Raises ConfigError."""
        from medusa.config.file import DEFAULT_FILE, load_config
        from medusa.errors import ConfigError

        if self.config is not None:
            return load_config(self.config)
        if self.sim:
            return None
        if not Path(DEFAULT_FILE).exists():
            raise ConfigError(
                DEFAULT_FILE,
                "",
                None,
                "does not exist; `medusa-ctl init` writes one, or name one by --config",
            )
        return load_config(DEFAULT_FILE)

    @asynccontextmanager
    async def head(
        self,
        *,
        homed: bool = False,
        joints: Collection[str] | None = None,
        enable: bool = False,
        amplifiers: bool = True,
        world: Any = None,
    ) -> AsyncIterator["tuple[JointGroup, SimulatedHead | None]"]:
        """The head, emulated or real, connected and at rest; enabled, or homed, when the command needs that.

        `joints`: those that the command moves (default: all). An emulated head has just been switched on: it is
        homed first, and that is said. A real one is never homed behind one's back. Raises CommandError then.
        Without `amplifiers` a real head's are left alone: neither their port nor their answers are needed.
        """
        from medusa.errors import CommandError
        from medusa.machines import open_head
        from medusa.mc3000.config import Mc3000Config

        if self.sim and (self.boards or self.amps):
            raise CommandError("--sim brings its own ports: leave --boards and --amps out")
        config = self.head_config()
        trace = self.open_trace()
        async with AsyncExitStack() as stack:
            if trace is not None:
                stack.callback(trace.close)
            simulated = None
            if self.sim:
                from medusa.simulation import simulated_head

                simulated = await stack.enter_async_context(simulated_head(self.seed, world=world))
                if not isinstance(config, Mc3000Config | None):
                    raise CommandError("--sim emulates MC3000 boards; the configuration is for another drive")
                head = await stack.enter_async_context(simulated.open(config, trace))
            else:
                if config is None:
                    raise AssertionError("a real head has a configuration")
                opening = open_head(config, self.boards, self.amps if amplifiers else False, trace=trace)
                head = await stack.enter_async_context(opening)
            if homed and self.sim:
                self.progress("simulated head, just switched on: homing it first")
                await head.home()
            elif homed:
                needed = head.traits if joints is None else joints
                reading = await head.read()
                away = [name for name, joint in reading.joints.items() if name in needed and not joint.homed]
                if away:
                    raise CommandError(f"{', '.join(away)}: not homed; run `medusa-ctl home` first")
                await head.enable(needed)
            elif enable:
                await head.enable()
            yield head, simulated
