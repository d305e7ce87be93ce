import pytest

from sim_devices.assembly import BenchConfig, build_parts, read_bench
from sim_devices.config import ConfigError, Faults, Incident, read_faults
from sim_devices.labmate import BaseConfig, Box, Bump
from sim_devices.link.faults import FaultPlan


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "bench.toml"
        path.write_text(text)
        return path

    return write


def test_without_a_file_the_bench_has_a_head_with_its_world_and_a_base():
    assert read_bench(None) == BenchConfig()
    parts = build_parts(BenchConfig(), seed=1)
    assert list(parts) == ["head", "world", "base"]
    assert {line for part in parts.values() for line in part.lines()} == {"mc3000", "servo-amps", "labmate"}


def test_a_plan_holds_the_bases_their_cameras_and_the_head_that_stands_on_one(write):
    config = read_bench(
        write(
            """
            plan = "corridor"
            [[base]]
            [[base]]
            address = 0x11
            start_x = 3.0
            [[camera]]
            name = "station"
            mount = { on = "world", x = 5.0, z = 0.5, yaw_deg = 180.0 }
            [[camera]]
            name = "side"
            mount = { on = "base2", y = 0.3, z = 0.35, yaw_deg = 90.0 }
            [head_on]
            on = "base"
            z = 0.8
            """
        )
    )
    parts = build_parts(config, seed=1)
    assert list(parts) == ["head", "world", "base", "base2"]
    assert list(parts["world"].cameras) == ["left", "right", "station", "side"]
    assert parts["base2"].clearance(0.0) == pytest.approx(0.725 - 0.35)
    places = {name: camera.pose(0.0).position for name, camera in parts["world"].cameras.items()}
    assert places["station"] == pytest.approx([5.0, 0.0, 0.5])
    assert places["side"] == pytest.approx([3.0, 0.3, 0.35])
    assert places["left"][2] == pytest.approx(0.8)


def test_in_a_plan_a_head_without_a_place_has_no_cameras(write):
    parts = build_parts(read_bench(write('plan = "corridor"')), seed=1)
    assert list(parts) == ["head", "world", "base"]
    assert not parts["world"].cameras


def test_a_plan_file_lies_beside_the_benchs_file(write, tmp_path):
    (tmp_path / "mine.toml").write_text("[[wall]]\npoints = [[-1.0, 1.0], [1.0, 1.0]]\n")
    parts = build_parts(read_bench(write('head = false\nplan = "mine.toml"')), seed=1)
    assert parts["base"].clearance(0.0) == pytest.approx(1.0 - 0.35)
    with pytest.raises(ConfigError, match=r"other\.toml: No such file"):
        read_bench(write('plan = "other.toml"'))


def test_several_bases_share_a_line_or_have_their_own(write):
    config = read_bench(
        write('head = false\n[[base]]\n[[base]]\naddress = 0x11\n[[base]]\nline = "second"\n')
    )
    parts = build_parts(config, seed=1)
    assert list(parts) == ["base", "base2", "base3"]
    assert [list(part.lines()) for part in parts.values()] == [["labmate"], ["labmate"], ["second"]]


def test_every_key_of_a_base_can_be_given(write):
    config = read_bench(
        write(
            """
            baud = 57600
            [[base]]
            start_x = 1.0
            start_heading_deg = 90
            wheel_base = 0.34
            diameter_ratio = 1.0
            slip_left = 0.01
            bumps = [{wheel = "left", at = 1.0, height = 0.01}]
            walls = [[0, 0, 1, 1]]
            boxes = [{x = 1, y = 2, length = 0.5, width = 0.5, yaw_deg = 45, low = true}]
            battery = 22.5
            """
        )
    )
    assert config.baud == 57600
    assert config.base == [
        BaseConfig(
            start_x=1.0,
            start_heading_deg=90.0,
            wheel_base=0.34,
            diameter_ratio=1.0,
            slip_left=0.01,
            bumps=[Bump("left", 1.0, 0.01)],
            walls=[(0.0, 0.0, 1.0, 1.0)],
            boxes=[Box(1.0, 2.0, 0.5, 0.5, 45.0, True)],
            battery=22.5,
        )
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("baud = 100", "baud = 100: expected `int` >= 300"),
        ("bode = 100", "unknown field `bode`; there are baud, head, world, base"),
        ("[[base]]\naddress = 200", "base[0].address = 200: expected `int` <= 126"),
        ("[[base]]\nwheel_base = -0.3", "base[0].wheel_base = -0.3: expected `float` > 0.0"),
        ("[[base]]\nwheel_base = 'wide'", "base[0].wheel_base = 'wide': expected `float`, got `str`"),
        ("[[base]]\n[[base]]\n", "base[1].address = 16: taken on line 'labmate' already"),
        ("[[base]]\nline = 'mc3000'", "base[0].line = 'mc3000': is the head's"),
        ("[[base]]\nbumps = [{wheel = 'middle', at = 1}]", "base[0].bumps[0].wheel = 'middle'"),
        ("[head]\nfriction_counts = -1", "head.friction_counts = -1: expected `float` >= 0.0"),
        ("baud = ", "Invalid value (at end of document)"),
        (
            "[[camera]]\nname = 'left'\nmount = { on = 'base' }",
            "camera[0].name = 'left': taken; choose another",
        ),
        (
            "head = false\n[[camera]]\nname = 'a'\nmount = { on = 'base' }",
            "camera: nothing to see; give a plan",
        ),
        (
            "plan = 'bend'\n[[camera]]\nname = 'a'\nmount = { on = 'base2' }",
            "camera[0].mount.on = 'base2': must be one of world, base",
        ),
        ("plan = 'bent'", "plan: no plan is called 'bent'; there are bend, corner, corridor"),
        ("plan = 'bend'\n[head_on]\non = 'table'", "head_on.on = 'table': must be one of world, base"),
        (
            "plan = 'bend'\n[[camera]]\nname = 'a b'\nmount = { on = 'base' }",
            "camera[0].name = 'a b': expected",
        ),
        (
            "plan = 'bend'\n[[camera]]\nname = 'a'\nmount = { on = 'base' }\nwindow = [250, 0, 64, 32]",
            "camera[0]: window(left=250, top=0, width=64, height=32) is not inside an image of 256 x 256",
        ),
    ],
)
def test_a_mistake_names_file_key_value_and_what_is_allowed_in_one_line(write, text, said):
    path = write(text)
    with pytest.raises(ConfigError) as caught:
        read_bench(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert said in message
    assert "\n" not in message


def test_a_missing_file_and_one_that_is_no_text_are_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        read_bench(tmp_path / "none.toml")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not UTF-8"):
        read_bench(tmp_path / "binary")


def test_a_faults_file_plans_lines_and_incidents(write):
    path = write(
        """
        [line.mc3000]
        drop = 0.05
        delay = 0.1
        delay_s = 0.3
        [[at]]
        time_s = 2.5
        verb = "head.amplifier_fault"
        arguments = { axis = "pan" }
        """
    )
    assert read_faults(path) == Faults(
        {"mc3000": FaultPlan(drop=0.05, delay=0.1, delay_s=0.3)},
        [Incident(2.5, "head.amplifier_fault", {"axis": "pan"})],
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[line.mc3000]\ndrop = 2", "line.mc3000: drop is 2.0, must be a probability from 0 to 1"),
        (
            "[line.mc3000]\ndorp = 0.1",
            "line.mc3000: object contains unknown field `dorp`; there are seed, drop",
        ),
        ("[line.mc3000]\ndrop = 'often'", "line.mc3000.drop = 'often': expected `float`"),
        ("[[at]]\ntime_s = -1\nverb = 'x'", "at[0].time_s = -1: expected `float` >= 0.0"),
        ("line = 3", "line = 3: expected tables [line.NAME]"),
    ],
)
def test_a_mistake_in_a_faults_file_is_named_as_well(write, text, said):
    with pytest.raises(ConfigError) as caught:
        read_faults(write(text))
    assert said in str(caught.value)
