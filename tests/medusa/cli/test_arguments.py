"""What is wrong is said in one line, with its exit code, and nothing moves."""

import os
import pty
import re
import select
import subprocess
import sys
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cobs import cobs

Ctl = Callable[..., Any]


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (["frob"], 2, r"No such command 'frob'"),
        (["--sim", "--frob", "status"], 2, r"No such option"),
        (["--sim", "move"], 2, r"nowhere to move: give --pan, --tilt, --left or --right"),
        (["--sim", "move", "--pan", "left"], 2, r"'--pan'.*number"),
        (
            ["--sim", "move", "--pan", "200"],
            2,
            r"pan: 200\.00° is outside the soft limits -93\.00\.\.93\.00°",
        ),
        (["--sim", "move", "--pan", "nan"], 2, r"pan: .*nan"),
        (["--sim", "jog", "pan", "9999"], 2, r"pan: a speed of 9999\.0°/s is over the limit of 180°/s"),
        (
            ["--sim", "jog", "pan", "0.5"],
            2,
            r"pan: 0\.5°/s is less than half a step .* slowest is 1\.758°/s",
        ),
        (["--sim", "jog", "nose", "3"], 2, r"no joint 'nose'; the head has pan, tilt"),
        (["--sim", "home", "nose"], 2, r"no joint 'nose'"),
        (["--sim", "check", "nose"], 2, r"no joint 'nose'"),
        (["--sim", "jog", "pan", "--frob"], 2, r"'SPEED'|'speed'|--frob"),
        (["--sim", "--seed", "-1", "status"], 2, r"'--seed'"),
        (["--sim", "--boards", "/dev/ttyUSB0", "status"], 2, r"leave --boards and --amps out"),
        (["--sim", "--trace", "/no/such/place", "status"], 4, r"/no/such/place: No such file"),
        (["--sim", "raw", "read", "pan", "ZZ"], 2, r"'ZZ' is not a hexadecimal byte"),
        (["--sim", "raw", "read", "pan", "0E", "9"], 2, r"'count'"),
        (["--sim", "raw", "read", "pan", "01"], 2, r"bad register"),
        (["--sim", "raw", "write", "pan", "08", "90"], 2, r"WRITE axis 0: wrong mode \(status 6\)"),
        (["status"], 3, r"medusa\.toml: does not exist; `medusa-ctl init` writes one"),
        (["--config", "other.toml", "status"], 3, r"other\.toml: cannot be read: No such file"),
        (["--sim", "--config", "/dev/null", "status"], 3, r"/dev/null: "),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_wrong_line_is_refused_in_one_line(
    ctl: Ctl, arguments: list[str], code: int, complaint: str
) -> None:
    ended = ctl(*arguments)
    assert re.search(complaint, ended.complaint), ended.complaint
    assert ended.code == code
    assert ended.out == ""


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (["--sim", "move", "--pan", "200"], 2, "soft limits"),
        (["--sim", "move"], 2, "nowhere to move"),
        (["--sim", "frob"], 2, "No such command"),
        (["--sim", "move", "--pan", "left"], 2, "'--pan'"),
        (["status"], 3, "does not exist"),
        (["--sim", "--trace", "/no/such/place", "status"], 4, "No such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_with_json_the_error_is_the_document(
    ctl: Ctl, arguments: list[str], code: int, complaint: str
) -> None:
    ended = ctl("--json", *arguments)
    assert ended.json["exit_code"] == ended.code == code
    assert complaint in ended.json["error"]
    assert ended.json["error"] == ended.complaint


@pytest.fixture
def head_file(ctl: Ctl, tmp_path: Path) -> Path:
    assert ctl("--sim", "init", "head.toml").code == 0
    return tmp_path / "head.toml"


def test_init_leaves_the_hazardous_keys_empty_and_the_first_of_them_is_named(ctl: Ctl) -> None:
    assert ctl("init").code == 0
    ended = ctl("status")
    assert ended.code == 3
    assert re.fullmatch(r"medusa\.toml: [\w.]+ = '': has to be filled in: .*", ended.complaint)


def test_init_does_not_replace_a_file(ctl: Ctl, head_file: Path) -> None:
    before = head_file.read_text()
    ended = ctl("init", "head.toml")
    assert (ended.code, head_file.read_text()) == (2, before)
    assert "--force" in ended.complaint


def test_init_replaces_a_file_but_never_a_folder_or_a_device(
    ctl: Ctl, head_file: Path, tmp_path: Path
) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to("head.toml")
    head_file.chmod(0o600)
    assert ctl("init", "link.toml", "--force").code == 0
    assert link.is_symlink()
    assert 'counts_per_degree = ""' in head_file.read_text()
    assert head_file.stat().st_mode & 0o777 == 0o600
    device = tmp_path / "device.toml"
    device.symlink_to("/dev/full")
    for path in ("device.toml", ".", "/"):
        ended = ctl("init", path, "--force")
        assert (ended.code, ended.complaint) == (3, f"{path}: is no regular file; it is not replaced")


def test_a_full_disk_ends_the_trace_but_not_the_command(ctl: Ctl, caplog: pytest.LogCaptureFixture) -> None:
    ended = ctl("--sim", "--json", "--trace", "/dev/full", "status")
    assert ended.code == 0
    assert len(ended.json["joints"]) == 4
    assert [record.getMessage() for record in caplog.records] == [
        "/dev/full: No space left on device; the trace ends here"
    ]


def test_the_demo_makes_its_folder_before_anything_moves(ctl: Ctl) -> None:
    ended = ctl("--sim", "demo", "--out", "/dev/null/here")
    assert (ended.code, ended.complaint) == (4, "/dev/null/here: Not a directory")
    assert "home" not in ended.err


@pytest.mark.parametrize(
    ("pattern", "replacement", "complaint"),
    [
        (
            r"(?m)^max_speed_deg_s = .*$",
            "max_speed_deg_s = 5000.0",
            r"max_speed_deg_s = 5000\.0: .*0 to 1000",
        ),
        (r"(?m)^sign = .*$", "sign = 2", r"sign = 2: one of -1, 1"),
        (r"(?m)^board_watchdog_ms = .*$", "board_watchdog_ms = 0", r"board_watchdog_ms = 0: .*50 to 5000"),
        (r"(?m)^settle_counts = .*$", 'settle_counts = "many"', r"settle_counts = 'many': an integer"),
        (r"(?m)^park_deg = .*$", "park_degrees = 1.0", r"park_deg"),
        (r"(?m)^sign = .*$", "sign = = 2", r"is not TOML"),
    ],
)
def test_a_mistake_in_the_file_names_file_key_value_and_what_is_allowed(
    ctl: Ctl, head_file: Path, pattern: str, replacement: str, complaint: str
) -> None:
    head_file.write_text(re.sub(pattern, replacement, head_file.read_text(), count=1))
    ended = ctl("--sim", "--config", "head.toml", "status")
    assert ended.code == 3
    assert ended.complaint.startswith("head.toml: ")
    assert re.search(complaint, ended.complaint), ended.complaint


@pytest.mark.parametrize(
    ("port", "reason"),
    [
        ("/dev/no-such-tty", "no such port"),
        ("/dev/null", "not a serial port"),
        ("head.toml", "not a serial port"),
    ],
)
def test_a_port_that_is_none_is_said_so(ctl: Ctl, head_file: Path, port: str, reason: str) -> None:
    ended = ctl("--config", "head.toml", "--boards", port, "--amps", port, "status")
    assert (ended.code, ended.complaint) == (4, f"{port}: {reason}")


def test_no_port_at_all_is_said_so(ctl: Ctl, head_file: Path) -> None:
    ended = ctl("--config", "head.toml", "status")
    assert ended.code == 2
    assert "no port for the boards" in ended.complaint


@pytest.mark.real_time
def test_a_busy_port_and_a_device_that_does_not_answer_are_said_so(ctl: Ctl, head_file: Path) -> None:
    master, slave = pty.openpty()
    path = os.ttyname(slave)
    try:
        silent = ctl("--config", "head.toml", "--boards", path, "status")
        assert silent.code == 5
        assert re.search(r"device 0[12]H, HELLO: no answer to 3 sendings", silent.complaint)
        # Another process, as another program would: a lock of this one would not be in its own way.
        holder = subprocess.Popen(
            [
                sys.executable,
                "-c",
                f"import serial; p = serial.Serial({path!r}, exclusive=True); print(flush=True); input()",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert holder.stdout is not None
        holder.stdout.readline()
        busy = ctl("--config", "head.toml", "--boards", path, "status")
        holder.communicate(b"\n")
        # The name is what /proc calls the interpreter, python3 or python3.11.
        told = re.fullmatch(rf"{path}: busy: python\S* \(process {holder.pid}\) has it open", busy.complaint)
        assert (busy.code, bool(told)) == (4, True)
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.real_time
def test_an_emergency_stop_goes_out_even_when_nobody_can_be_heard(ctl: Ctl, head_file: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        ended = ctl("--config", "head.toml", "--boards", os.ttyname(slave), "estop")
        sent = os.read(master, 4096)
    finally:
        os.close(master)
        os.close(slave)
    assert ended.code == 5
    messages = [cobs.decode(frame) for frame in sent.split(b"\0") if frame]
    assert [message[:4] for message in messages[:3]] == [
        bytes([0x00, number, 0x05, 0x0F]) for number in range(3)
    ]
    # Then to each board.
    assert {message[0] for message in messages[3:5]} == {0x01, 0x02}


@pytest.mark.real_time
@pytest.mark.parametrize("text", [None, "", "ports = = 1"])
def test_an_emergency_stop_goes_out_whatever_the_file_says(
    ctl: Ctl, tmp_path: Path, text: str | None
) -> None:
    if text is not None:
        (tmp_path / "head.toml").write_text(text)
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        path = os.ttyname(slave)
        ended = ctl("--config", "head.toml", "--boards", path, "estop")
        sent = b""
        # The terminal's own buffer hands on what was written a little later, and in parts.
        while select.select([master], [], [], 0.5)[0]:
            sent += os.read(master, 4096)
    finally:
        os.close(master)
        os.close(slave)
    assert ended.code == 3
    assert f"the emergency stop went out to all of {path}, and cannot be confirmed" in ended.complaint
    assert [cobs.decode(frame)[:4] for frame in sent.split(b"\0") if frame] == [
        bytes([0x00, number, 0x05, 0x0F]) for number in range(3)
    ]


@pytest.mark.parametrize("arguments", [["--help"], ["move", "--help"], ["demo", "--help"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    program = (
        "import sys; sys.argv = ['medusa-ctl', *sys.argv[1:]]\n"
        "from medusa.cli import main\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'numpy', 'msgspec', 'matplotlib', 'cv2', 'control', 'scipy', 'serial', 'sim_devices'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program, *arguments], check=True, stdout=subprocess.DEVNULL)
