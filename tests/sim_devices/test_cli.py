"""sim-devices as its users meet it: real processes, real signals, a real socket."""

import json
import os
import select
import signal
import socket
import stat
import subprocess
import sys
import time

import pytest

from sim_devices.link.frame import FrameReceiver, encode_frame

PROGRAM = [sys.executable, "-m", "sim_devices"]
DEADLINE_S = 60

pytestmark = pytest.mark.real_time


def call(*arguments, **options):
    return subprocess.run(
        [*PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=DEADLINE_S, **options
    )


def start(*arguments, **options):
    """Start a bench without cameras; return the process and the lines up to "ready"."""
    process = subprocess.Popen(
        [*PROGRAM, "run", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )
    lines = []
    for line in process.stdout:
        lines.append(line.strip())
        if lines[-1] == "ready":
            break
    return process, lines


def end(process, number=signal.SIGTERM):
    process.send_signal(number)
    _, errors = process.communicate(timeout=DEADLINE_S)
    return process.returncode, errors


def ask(path, frame):
    """Send a frame to a port as a client of its own and return the first answer."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        os.write(fd, frame)
        receiver = FrameReceiver()
        while select.select([fd], [], [], DEADLINE_S)[0]:
            for message in receiver.feed(os.read(fd, 4096)):
                return message
    finally:
        os.close(fd)
    raise AssertionError("no answer")


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    directory = tmp_path_factory.mktemp("bench")
    config = directory / "bench.toml"
    config.write_text("world = false\n")
    links = directory / "links"
    process, lines = start("--config", config, "--links", links, "--seed", 5)
    yield links, lines
    code, errors = end(process)
    assert (code, errors) == (0, "")
    assert os.listdir(links) == []


def test_prints_a_line_for_each_port_and_then_ready(bench):
    links, lines = bench
    assert lines == [
        f"mc3000 {links}/mc3000",
        f"servo-amps {links}/servo-amps",
        f"labmate {links}/labmate",
        "ready",
    ]


@pytest.mark.parametrize(
    ("line", "address", "kind"), [("mc3000", 1, 1), ("mc3000", 2, 1), ("labmate", 0x10, 2)]
)
def test_the_devices_answer_at_their_links(bench, line, address, kind):
    reply = ask(bench[0] / line, encode_frame(address, 0, 1, 1, 15, b"ab"))
    assert (reply.address, reply.operation, reply.axis, reply.payload[:4]) == (
        address,
        1,
        0,
        b"ab" + bytes((1, kind)),
    )


def test_the_socket_is_its_owners_alone(bench):
    mode = stat.S_IMODE(os.stat(bench[0] / "control").st_mode)
    assert mode == 0o600


def test_inspect_shows_the_true_state(bench):
    state = json.loads(call("inspect", "--links", bench[0]).stdout)
    assert set(state) == {"time", "lines", "head", "base"}
    assert set(state["head"]["joints"]) == {"pan", "tilt", "left_vergence", "right_vergence"}
    assert state["base"]["pose"] == {"x": 0.0, "y": 0.0, "heading": 0.0}


def test_inject_acts_and_inspect_shows_it(bench):
    links = bench[0]
    assert call("inject", "base.press_bumper", "side=front", "--links", links).returncode == 0
    assert json.loads(call("inspect", "--links", links).stdout)["base"]["bumpers"] == ["front"]
    assert call("inject", "base.release_bumper", "side=front", "--links", links).returncode == 0


def test_inject_without_a_verb_lists_them_all(bench):
    listed = call("inject", "--links", bench[0]).stdout
    assert "base.bump(wheel: str, height: float = 0.01) Lay a round obstacle" in listed
    assert "head.amplifier_fault(axis: str" in listed
    assert "wire.hang_up(line: str, seconds: float)" in listed


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["base.fly"], 1, "no verb 'base.fly'; there are base.break_bumper"),
        (["base.press_bumper", "side=top"], 1, "side is 'top', must be one of front, rear, left, right"),
        (["base.press_bumper", "front"], 2, "'front' is not of the form NAME=VALUE"),
        (["wire.unplug", "line=usb"], 1, "no line 'usb'; there are labmate, mc3000, servo-amps"),
    ],
)
def test_a_wrong_verb_or_argument_gets_one_clear_line(bench, arguments, code, said):
    result = call("inject", *arguments, "--links", bench[0])
    assert result.returncode == code
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "line", [b"nonsense\n", b"[]\n", b'{"verb": 3}\n', b'{"verb": "inspect", "arguments": 4}\n', b"\xff\n"]
)
def test_garbage_on_the_socket_is_answered_and_the_bench_lives(bench, line):
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(bench[0] / "control"))
        client.sendall(line)
        with client.makefile("rb") as stream:
            assert "must be" in json.loads(stream.readline())["error"]
            client.sendall(b'{"verb": "verbs"}\n')
            assert "result" in json.loads(stream.readline())


def test_a_line_without_end_hangs_up_and_the_bench_lives(bench):
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(DEADLINE_S)
        client.connect(str(bench[0] / "control"))
        with pytest.raises(OSError):
            client.sendall(b"x" * 10_000_000)
    assert call("inspect", "--links", bench[0]).returncode == 0


def test_a_directory_that_is_served_is_not_served_twice(bench):
    result = call("run", "--links", bench[0])
    assert result.returncode == 1
    assert result.stderr == f"sim-devices: {bench[0]}/control: another sim-devices serves this directory\n"
    assert ask(bench[0] / "labmate", encode_frame(0x10, 0, 1, 2, 15)).axis == 0


def test_sigint_ends_it_cleanly_and_what_was_killed_before_is_cleared_away(tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("world = false\nhead = false\n")
    process, _ = start("--config", config, "--links", tmp_path / "links")
    process.kill()
    process.communicate(timeout=DEADLINE_S)
    assert sorted(os.listdir(tmp_path / "links")) == ["control", "labmate"]
    result = call("inspect", "--links", tmp_path / "links")
    assert result.returncode == 1
    assert "is sim-devices running?" in result.stderr
    process, lines = start("--config", config, "--links", tmp_path / "links")
    assert lines == [f"labmate {tmp_path}/links/labmate", "ready"]
    assert end(process, signal.SIGINT) == (0, "")
    assert os.listdir(tmp_path / "links") == []


def test_faults_and_incidents_of_a_file_happen(tmp_path):
    (tmp_path / "bench.toml").write_text("world = false\nhead = false\n")
    (tmp_path / "faults.toml").write_text(
        "[line.labmate]\ndrop = 0.0\n"
        '[[at]]\ntime_s = 1.0\nverb = "base.drain_battery"\narguments = { volts = 21.0 }\n'
    )
    process, _ = start(
        "--config", tmp_path / "bench.toml", "--faults", tmp_path / "faults.toml",
        "--links", tmp_path / "links", "--speed", 50,
    )  # fmt: skip
    ends = time.monotonic() + DEADLINE_S
    volts = 24.0
    while volts > 22 and time.monotonic() < ends:
        volts = json.loads(call("inspect", "--links", tmp_path / "links").stdout)["base"]["battery_volts"]
    assert volts == pytest.approx(21.0, abs=0.1)
    assert end(process)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--speed", "0"], 2, "--speed is 0, must be from 0.001 to 1000"),
        (["--log", "loud"], 2, "--log is 'loud', must be debug, info, warning or error"),
        (["--config", "none.toml"], 2, "none.toml: No such file or directory"),
        (["--faults", "bad.toml"], 2, "bad.toml: line.labmate: drop is 7.0, must be a probability"),
        (["--faults", "verb.toml"], 1, "at[0].verb = 'base.fly': no such verb"),
        (["--faults", "line.toml"], 1, "faults for line 'usb', there are labmate"),
        (["--links", "taken"], 1, "taken: File exists"),
        (["--links", "taken/below"], 1, "taken/below: Not a directory"),
        (["--links", "/proc/nowhere"], 1, "/proc/nowhere: No such file or directory"),
        (["--links", "d" * 120], 1, "a socket's path has at most 107 bytes"),
        (["--seed", "x"], 2, "Invalid value for '--seed'"),
        (["--sped", "2"], 2, "No such option: --sped"),
        (["somewhere"], 2, "unexpected extra argument"),
    ],
)
def test_a_wrong_start_gets_one_clear_line(tmp_path, arguments, code, said):
    (tmp_path / "bench.toml").write_text("world = false\nhead = false\n")
    (tmp_path / "bad.toml").write_text("[line.labmate]\ndrop = 7\n")
    (tmp_path / "verb.toml").write_text("[[at]]\ntime_s = 1\nverb = 'base.fly'\n")
    (tmp_path / "line.toml").write_text("[line.usb]\ndrop = 0.5\n")
    (tmp_path / "taken").write_text("")
    default = [] if "--config" in arguments else ["--config", "bench.toml"]
    result = call("run", *default, *arguments, cwd=tmp_path)
    assert result.returncode == code
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_full_disk_under_the_output_is_one_clear_line(tmp_path):
    (tmp_path / "bench.toml").write_text("world = false\nhead = false\n")
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [*PROGRAM, "run", "--config", tmp_path / "bench.toml", "--links", tmp_path / "links"],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=DEADLINE_S,
        )  # fmt: skip
    assert result.returncode == 1
    assert "No space left on device" in result.stderr
    assert "Traceback" not in result.stderr
    assert os.listdir(tmp_path / "links") == []


def test_help_imports_nothing_heavy():
    code = (
        "import sys, sim_devices.cli as c\n"
        "sys.argv = ['sim-devices', 'run', '--help']\n"
        "try: c.main()\n"
        "except SystemExit: pass\n"
        "print({'numpy', 'msgspec', 'matplotlib', 'cv2'} & set(sys.modules))\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=DEADLINE_S)
    assert "--faults" in result.stdout
    assert result.stdout.strip().endswith("set()")
