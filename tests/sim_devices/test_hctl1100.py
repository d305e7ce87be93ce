"""The chip by itself, register by register (docs/protocols, the axis-control chip)."""

import pytest

from sim_devices.hctl1100 import READABLE, WRITABLE, Hctl1100


@pytest.fixture
def chip():
    return Hctl1100()


def control(chip, *, filter_bytes=(0, 0, 4)):
    for register, value in zip((0x20, 0x21, 0x22), filter_bytes, strict=True):
        chip.write(register, value)
    chip.write(0x05, 0x03)
    return chip


def sample(chip, count=None):
    if count is not None:
        chip.count = count
    chip.update_command()
    chip.update_output()
    return chip.read(0x08)


def write(chip, register, *values):
    for offset, value in enumerate(values):
        chip.write(register + offset, value)


def command(chip, position):
    write(chip, 0x0C, *(position & 0xFFFFFF).to_bytes(3, "big"))


class TestRegisterTable:
    def test_readable_are_exactly_those_of_the_page(self):
        assert (
            {0x00, 0x07, 0x08, 0x09, 0x0C, 0x0D, 0x0E, 0x0F, 0x12, 0x13, 0x14}
            | set(range(0x18, 0x20))
            | {0x20, 0x21, 0x22, 0x23, 0x24, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x34, 0x35, 0x3C}
        ) == READABLE

    def test_writable_are_those_without_the_read_only_and_with_the_write_only_ones(self):
        assert (READABLE - {0x12, 0x14, 0x34, 0x35}) | {0x05, 0x15, 0x16, 0x17} == WRITABLE

    def test_a_register_that_cannot_be_read_is_an_error(self, chip):
        with pytest.raises(ValueError, match="15H"):
            chip.read(0x15)


class TestReset:
    def check(self, chip):
        assert [chip.read(r) for r in (0x20, 0x21, 0x22, 0x0F)] == [0xE5, 0x40, 0x40, 0x40]
        assert chip.read(0x07) == 0xE0
        assert chip.read(0x00) == 0x02
        assert chip.read(0x08) == 0x80
        zero = READABLE - {0x00, 0x07, 0x08, 0x0F, 0x20, 0x21, 0x22}
        assert {register: chip.read(register) for register in zero} == dict.fromkeys(zero, 0)

    def test_values_after_power_up(self, chip):
        self.check(chip)

    def test_program_counter_00_brings_them_back_from_anywhere(self, chip):
        chip.count = 777
        for register in sorted(WRITABLE - {0x00, 0x05, 0x13}):
            chip.write(register, 0x55)
        write(chip, 0x00, 0x0A)
        write(chip, 0x00, 0x0D)
        control(chip)
        sample(chip)
        chip.write(0x05, 0x00)
        self.check(chip)


class TestFlags:
    @pytest.mark.parametrize("flag", [0, 2, 3, 4, 5])
    def test_the_host_sets_and_clears_each(self, chip, flag):
        chip.write(0x00, 0x08 | flag)
        assert chip.read(0x00) == 0x02 | 1 << flag
        chip.write(0x00, flag)
        assert chip.read(0x00) == 0x02

    def test_f1_is_the_chips_own(self, chip):
        chip.write(0x00, 0x01)
        assert chip.read(0x00) == 0x02
        control(chip)
        chip.write(0x00, 0x09)
        assert chip.read(0x00) == 0x00

    def test_status_shows_f0_and_f1(self, chip):
        chip.write(0x00, 0x08)
        assert chip.read(0x07) == 0xF0
        control(chip)
        assert chip.read(0x07) == 0xD0


class TestStatus:
    def test_a_write_sets_the_low_nibble_and_nothing_else(self, chip):
        chip.write(0x07, 0xF5)
        assert chip.read(0x07) == 0xE5
        chip.write(0x07, 0x00)
        assert chip.read(0x07) == 0xE0

    def test_limit_reads_0_when_triggered_until_the_pin_is_high_and_07h_is_written(self, chip):
        assert chip.set_limit_pin(True)
        assert chip.read(0x07) == 0x60
        chip.write(0x07, 0x00)
        assert chip.read(0x07) == 0x60
        chip.set_limit_pin(False)
        assert chip.read(0x07) == 0x60
        chip.write(0x07, 0x00)
        assert chip.read(0x07) == 0xE0

    def test_stop_latches_and_releases_alike(self, chip):
        assert chip.set_stop_pin(True)
        assert not chip.set_stop_pin(True)
        chip.set_stop_pin(False)
        assert chip.read(0x07) == 0xA0
        chip.write(0x07, 0x00)
        assert chip.read(0x07) == 0xE0


class TestInitIdle:
    def test_motor_command_and_pwm_can_be_written_there(self, chip):
        write(chip, 0x08, 0xFF, 0x9C)
        assert (chip.motor_command, chip.read(0x08), chip.read(0x09)) == (127, 0xFF, 0x9C)
        chip.write(0x08, 0x00)
        assert chip.motor_command == -128

    def test_but_not_in_control(self, chip):
        control(chip)
        write(chip, 0x08, 0xFF, 0x64)
        assert (chip.read(0x08), chip.read(0x09)) == (0x80, 0)

    def test_entering_it_zeroes_the_command_and_clears_the_filter(self, chip):
        control(chip, filter_bytes=(128, 0, 4))
        command(chip, 50)
        assert sample(chip) == 0x80 + 50
        chip.write(0x05, 0x01)
        assert (chip.read(0x08), chip.read(0x00) & 2) == (0x80, 2)
        chip.write(0x05, 0x03)
        # 50 − ½·0: the sample before is forgotten.
        assert sample(chip) == 0x80 + 50

    def test_the_position_counter_keeps_counting(self, chip):
        chip.count = 123
        assert chip.actual == 123

    def test_program_counters_elsewhere_are_ignored(self, chip):
        chip.write(0x05, 0x02)
        assert chip.read(0x00) == 0x02
        control(chip)
        command(chip, 9)
        chip.write(0x05, 0x03)
        assert sample(chip) == 0x80 + 9

    def test_limit_low_sends_it_straight_back(self, chip):
        chip.set_limit_pin(True)
        control(chip)
        assert chip.read(0x00) & 2

    @pytest.mark.parametrize(("flag", "number"), [(0x01, 0), (0x08, 3), (0x20, 5), (0, 4)])
    def test_limit_goes_there_from_any_mode_and_leaves_the_flags(self, chip, flag, number):
        chip.write(0x27, 1)
        chip.write(0x28, 10)
        chip.write(0x2A, 10)
        control(chip)
        chip.write(0x00, 0x08 | number)
        sample(chip, 5)
        chip.set_limit_pin(True)
        assert chip.read(0x00) & (0x29 | 2) == flag | 2
        assert chip.read(0x08) == 0x80


class TestPosition:
    def test_writing_0eh_takes_all_three_bytes(self, chip):
        write(chip, 0x0C, 0x12, 0x34)
        assert chip.command == 0
        chip.write(0x0E, 0x56)
        assert chip.command == 0x123456
        assert [chip.read(r) for r in (0x0C, 0x0D, 0x0E)] == [0x12, 0x34, 0x56]
        write(chip, 0x0C, 0xFF, 0xFF, 0xFE)
        assert chip.command == -2

    def test_reading_14h_latches_all_three(self, chip):
        chip.count = 0x10FFFF
        assert chip.read(0x14) == 0xFF
        chip.count = 0x110000
        assert [chip.read(r) for r in (0x13, 0x12)] == [0xFF, 0x10]
        assert [chip.read(r) for r in (0x14, 0x13, 0x12)] == [0x00, 0x00, 0x11]

    def test_it_wraps_at_24_bits(self, chip):
        chip.count = 0x7FFFFF
        assert chip.actual == 0x7FFFFF
        chip.count = 0x800000
        assert chip.actual == -0x800000

    def test_the_error_across_the_wrap_is_the_short_one(self, chip):
        control(chip)
        chip.count = 0x7FFFFF
        command(chip, -0x800000)
        assert sample(chip) == 0x80 + 1

    def test_anything_written_to_13h_zeroes_it(self, chip):
        chip.count = 500
        chip.write(0x13, 0xAB)
        assert chip.actual == 0
        chip.count = 510
        assert chip.actual == 10

    def test_writing_17h_presets_it_in_idle(self, chip):
        chip.count = 40
        write(chip, 0x15, 0xFF, 0x00)
        assert chip.actual == 40
        chip.write(0x17, 0x01)
        assert chip.actual == -0x00FFFF

    def test_in_control_a_preset_does_nothing(self, chip):
        control(chip)
        write(chip, 0x15, 1, 2, 3)
        assert chip.actual == 0

    def test_a_step_goes_straight_through_the_filter(self, chip):
        control(chip)
        command(chip, 100)
        assert sample(chip) == 0x80 + 100


class TestStorage:
    def test_commutator_registers_keep_what_is_written_until_a_reset(self, chip):
        write(chip, 0x18, *range(1, 9))
        assert [chip.read(r) for r in range(0x18, 0x20)] == [1, 2, 3, 4, 5, 6, 7, 8]
        chip.write(0x05, 0x00)
        assert [chip.read(r) for r in range(0x18, 0x20)] == [0] * 8
