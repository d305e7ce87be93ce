"""The chip's filter and its three motions (docs/protocols, the axis-control chip)."""

import pytest

from sim_devices.hctl1100 import Hctl1100


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


class TestFilter:
    def test_is_the_difference_equation_of_the_page(self, chip):
        # K = 2, zero .5, pole −.25: MC = 2X − ½·2·X₁ − ¼·MC₁.
        control(chip, filter_bytes=(128, 64, 8))
        command(chip, 20)
        outputs = [sample(chip, count) - 0x80 for count in (0, 5, 10, 18)]
        # 40; 30 − 20 − 10 = 0; 20 − 15 − 0 = 5; 4 − 10 − 1.25 = −7.25.
        assert outputs == [40, 0, 5, -7]

    def test_truncates_toward_zero_on_both_sides(self, chip):
        control(chip, filter_bytes=(0, 0, 1))
        command(chip, 7)
        assert sample(chip) == 0x80 + 1
        command(chip, -7)
        assert sample(chip) == 0x80 - 1

    def test_clamps_and_feeds_the_clamped_value_back(self, chip):
        # MC = X − ½·MC₁: 300 → 127, not 300, comes back.
        control(chip, filter_bytes=(0, 128, 4))
        command(chip, 300)
        assert sample(chip) == 0xFF
        command(chip, 0)
        assert sample(chip) == 0x80 - 63
        command(chip, -300)
        assert sample(chip) == 0x00

    def test_uses_the_full_24_bit_error(self, chip):
        control(chip)
        command(chip, 0x7FFFFF)
        assert sample(chip) == 0xFF


class TestProportionalVelocity:
    def start(self, chip, filter_bytes=(255, 255, 12)):
        chip.write(0x00, 0x0B)
        return control(chip, filter_bytes=filter_bytes)

    def test_is_k_times_the_error_without_a_and_b(self, chip):
        self.start(chip)
        write(chip, 0x23, 0x48, 0x00)
        # 72/16 = 4.5 counts/sample; at 2 counts/sample 3·2.5 = 7.5, twice alike although A and B are not 0.
        sample(chip, 0)
        assert [sample(chip, 2) - 0x80, sample(chip, 4) - 0x80] == [7, 7]

    def test_each_byte_acts_at_once(self, chip):
        self.start(chip, (0, 0, 4))
        chip.write(0x24, 0x01)
        assert sample(chip) == 0x80 + 16
        chip.write(0x23, 0x80)
        assert sample(chip) == 0x80 + 24
        chip.write(0x24, 0xFF)
        assert sample(chip) == 0x80 - 8
        assert (chip.read(0x23), chip.read(0x24)) == (0x80, 0xFF)

    def test_only_here_is_the_actual_velocity_computed(self, chip):
        control(chip)
        sample(chip, 5)
        assert (chip.read(0x34), chip.read(0x35)) == (0, 0)
        chip.write(0x00, 0x0B)
        sample(chip, 2)
        assert (chip.read(0x34), chip.read(0x35)) == (0xFD, 0xFF)


class TestIntegralVelocity:
    def start(self, chip, acceleration_256):
        chip.write(0x26, acceleration_256 & 0xFF)
        chip.write(0x27, acceleration_256 >> 8)
        chip.write(0x00, 0x0D)
        return control(chip)

    def test_the_velocity_ramps_and_the_command_is_the_floor_of_its_sum(self, chip):
        self.start(chip, 0x80)
        chip.write(0x3C, 2)
        commands = []
        for _ in range(6):
            sample(chip)
            commands.append(chip.command)
        # v = .5, 1, 1.5, 2, 2, 2; its sum .5, 1.5, 3, 5, 7, 9.
        assert commands == [0, 1, 3, 5, 7, 9]

    def test_down_too(self, chip):
        self.start(chip, 0x180)
        chip.write(0x3C, 0xFD)
        commands = []
        for _ in range(3):
            sample(chip)
            commands.append(chip.command)
        # −1.5, −4.5, −7.5: floors.
        assert commands == [-2, -5, -8]
        assert chip.read(0x3C) == 0xFD

    def test_stop_decelerates_and_holds_until_released_and_written_anew(self, chip):
        self.start(chip, 0x100)
        chip.write(0x3C, 3)
        for _ in range(4):
            sample(chip)
        chip.set_stop_pin(True)
        for _ in range(5):
            sample(chip)
        stood = chip.command
        # 1 + 2 + 3 + 3, then 2 + 1 + 0.
        assert stood == 12
        chip.write(0x3C, 5)
        sample(chip)
        chip.set_stop_pin(False)
        chip.write(0x07, 0)
        sample(chip)
        # Released, but the velocity was written while it still held.
        assert chip.command == stood
        chip.write(0x3C, 1)
        sample(chip)
        assert chip.command == stood + 1

    def test_stop_acts_in_no_other_mode(self, chip):
        control(chip)
        chip.set_stop_pin(True)
        command(chip, 9)
        assert sample(chip) == 0x80 + 9


class TestTrapezoid:
    def test_runs_from_the_command_position_and_clears_f0_with_the_last_command(self, chip):
        write(chip, 0x26, 0x00, 0x01, 20)
        write(chip, 0x29, 0x64, 0x00, 0x00)
        control(chip)
        command(chip, 50)
        chip.write(0x00, 0x08)
        commands = []
        while chip.read(0x00) & 1:
            sample(chip)
            commands.append(chip.command)
        # 50 to go at a = 1: n_a = √50 = 7.07, N = 14.14: samples 0 … 15.
        assert (commands[0], commands[1], commands[2]) == (50, 50, 52)
        assert (len(commands), commands[-1]) == (16, 100)

    def test_final_position_is_lsb_first(self, chip):
        write(chip, 0x29, 0xFE, 0xFF, 0xFF)
        assert chip.final == -2
        assert [chip.read(r) for r in (0x29, 0x2A, 0x2B)] == [0xFE, 0xFF, 0xFF]

    def test_parameters_are_taken_when_f0_is_set(self, chip):
        write(chip, 0x26, 0x00, 0x01, 20)
        write(chip, 0x29, 0x64, 0x00, 0x00)
        control(chip)
        chip.write(0x00, 0x08)
        write(chip, 0x26, 0x00, 0x00, 0)
        write(chip, 0x29, 0, 0, 0)
        for _ in range(30):
            sample(chip)
        assert chip.command == 100

    def test_acceleration_has_15_bits_and_the_maximum_7(self, chip):
        write(chip, 0x26, 0xFF, 0xFF, 0xFF)
        assert (chip.acceleration, chip.maximum_velocity) == (0x7FFF, 0x7F)
        assert [chip.read(r) for r in (0x26, 0x27, 0x28)] == [0xFF, 0x7F, 0x7F]
