"""The bench over a part with two lines: what parts share, what verbs may do, what state shows."""

import asyncio
import os

import pytest

from sim_devices.bench import Bench, UnknownVerb
from sim_devices.link.faults import FaultPlan


class Wire:
    """One end of a machine: says what it is told to say."""

    def __init__(self, machine):
        self.machine = machine
        self.heard = b""
        self.send = lambda data, t: None

    def receive(self, data, t):
        self.heard += data
        self.machine.due = t + 1.0

    def advance_to(self, t):
        self.machine.advance_to(t)

    def next_due(self):
        return self.machine.due


class Machine:
    """A part with the lines "north" and "south", which is due a second after any byte on either."""

    def __init__(self):
        self.north, self.south = Wire(self), Wire(self)
        self.powered = None
        self.due = None
        self.woken = []
        self.now = 0.0
        self.verbs = {"say": self.say, "refuse": self.refuse}

    def power_up(self, t):
        self.powered = t

    def lines(self):
        return {"north": [self.north], "south": [self.south]}

    def advance_to(self, t):
        self.now = max(self.now, t)
        if self.due is not None and self.due <= t:
            self.woken.append(t)
            self.due = None

    def state(self):
        return {"now": self.now}

    def say(self, text: str, loud: bool = False):
        """Say something on the northern line."""
        self.north.send(text.upper().encode() if loud else text.encode(), self.now)
        return len(text)

    def refuse(self):
        raise ValueError("it will not")


async def test_parts_are_powered_up_at_the_loops_time():
    await asyncio.sleep(5.0)
    machine = Machine()
    async with Bench({"machine": machine}):
        assert machine.powered == 5.0


async def test_ports_are_terminals_under_stable_names_and_go_with_the_bench(tmp_path):
    async with Bench({"machine": Machine()}, links=tmp_path) as bench:
        assert bench.ports == {"north": f"{tmp_path}/north", "south": f"{tmp_path}/south"}
        for path in bench.ports.values():
            fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
            assert os.isatty(fd)
            os.close(fd)
        bench.inject("wire.unplug", line="north")
        bench.inject("wire.plug", line="north")
        os.close(os.open(bench.ports["north"], os.O_RDWR | os.O_NOCTTY))
    assert os.listdir(tmp_path) == []


async def test_without_a_directory_the_bench_makes_one_and_removes_it():
    async with Bench({"machine": Machine()}) as bench:
        path = bench.ports["north"]
    with pytest.raises(FileNotFoundError):
        os.stat(os.path.dirname(path))


async def test_what_one_line_hears_wakes_the_other_lines_of_the_machine():
    machine = Machine()
    async with Bench({"machine": machine}) as bench:
        fd = os.open(bench.ports["south"], os.O_RDWR | os.O_NOCTTY)
        os.write(fd, b"x")
        await asyncio.sleep(2.0)
        os.close(fd)
    assert machine.woken == [pytest.approx(1.0 + 10 / 115200)]


async def test_parts_that_name_the_same_line_share_it():
    one, two = Machine(), Machine()
    async with Bench({"one": one, "two": two}) as bench:
        assert sorted(bench.ports) == ["north", "south"]
        fd = os.open(bench.ports["north"], os.O_RDWR | os.O_NOCTTY)
        os.write(fd, b"both")
        await asyncio.sleep(0.1)
        os.close(fd)
    assert (one.north.heard, two.north.heard) == (b"both", b"both")


async def test_a_verb_acts_at_the_present_instant_and_returns_what_it_returns():
    machine = Machine()
    async with Bench({"machine": machine}) as bench:
        fd = os.open(bench.ports["north"], os.O_RDWR | os.O_NOCTTY)
        await asyncio.sleep(3.0)
        assert bench.inject("machine.say", text="hello", loud=True) == 5
        assert machine.now == 3.0
        await asyncio.sleep(0.1)
        assert os.read(fd, 100) == b"HELLO"
        os.close(fd)


@pytest.mark.parametrize(
    ("verb", "arguments", "said"),
    [
        ("machine.sing", {}, "no verb 'machine.sing'; there are machine.refuse, machine.say, wire.faults"),
        ("__class__", {}, "no verb"),
        ("machine.state", {}, "no verb"),
        ("machine.say", {}, r"machine.say\(text: str, loud: bool = False\): missing a required argument"),
        ("machine.say", {"txt": "x"}, "missing a required argument: 'text'"),
    ],
)
async def test_a_verb_that_there_is_not_is_refused_with_those_that_there_are(verb, arguments, said):
    async with Bench({"machine": Machine()}) as bench:
        with pytest.raises(UnknownVerb, match=said):
            bench.inject(verb, **arguments)


async def test_an_argument_of_another_kind_is_refused_with_its_name_and_value():
    machine = Machine()
    async with Bench({"part": machine}) as bench:
        with pytest.raises(ValueError, match="loud = 'perhaps': expected `bool`, got `str`"):
            bench.inject("part.say", text="x", loud="perhaps")


async def test_a_verb_may_refuse_and_a_line_must_exist():
    async with Bench({"machine": Machine()}) as bench:
        with pytest.raises(ValueError, match="it will not"):
            bench.inject("machine.refuse")
        with pytest.raises(ValueError, match="no line 'west'; there are north, south"):
            bench.inject("wire.stall", line="west", seconds=1)
        with pytest.raises(ValueError, match="seconds is -1, must be above 0"):
            bench.inject("wire.hang_up", line="north", seconds=-1)


async def test_the_state_is_that_of_the_present_instant():
    async with Bench({"machine": Machine()}) as bench:
        await asyncio.sleep(4.0)
        assert bench.state() == {
            "time": 4.0,
            "lines": {
                "north": {"plugged": True, "lost_bytes": 0},
                "south": {"plugged": True, "lost_bytes": 0},
            },
            "machine": {"now": 4.0},
        }


async def test_faults_are_planned_per_line_from_the_benchs_seed():
    async def heard(seed):
        machine = Machine()
        async with Bench({"machine": machine}, seed=seed, faults={"north": FaultPlan(drop=0.5)}) as bench:
            for path, _ in zip(bench.ports.values(), "ns", strict=True):
                fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
                for n in range(40):
                    os.write(fd, bytes((n,)))
                    await asyncio.sleep(0.01)
                os.close(fd)
        return machine.north.heard, machine.south.heard

    north, south = await heard(1)
    assert len(south) == 40
    assert 5 < len(north) < 35
    assert (await heard(1))[0] == north
    assert (await heard(2))[0] != north


async def test_faults_for_a_line_that_there_is_not_are_refused():
    with pytest.raises(ValueError, match="faults for line 'west', there are north, south"):
        async with Bench({"machine": Machine()}, faults={"west": FaultPlan()}):
            pass


async def test_a_bench_that_cannot_make_its_links_leaves_nothing_behind(tmp_path):
    (tmp_path / "south").write_text("in the way")
    with pytest.raises(FileExistsError):
        async with Bench({"machine": Machine()}, links=tmp_path):
            pass
    assert os.listdir(tmp_path) == ["south"]


async def test_a_wire_can_be_made_faulty_and_whole_while_it_runs():
    machine = Machine()
    async with Bench({"machine": machine}, seed=1) as bench:
        fd = os.open(bench.ports["north"], os.O_RDWR | os.O_NOCTTY)
        for text, faults in (
            (b"a", {"drop": 1.0}),
            (b"b", {}),
            (b"c", {"drop": 1.0, "direction": "to_host"}),
        ):
            bench.inject("wire.faults", line="north", **faults)
            os.write(fd, text)
            await asyncio.sleep(0.1)
        os.close(fd)
        with pytest.raises(ValueError, match=r"drop is 2\.0, must be a probability"):
            bench.inject("wire.faults", line="north", drop=2)
        with pytest.raises(ValueError, match="unknown field `dorp`"):
            bench.inject("wire.faults", line="north", dorp=0.1)
    assert machine.north.heard == b"bc"
