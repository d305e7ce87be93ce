"""24-bit positions as the chip stores them, and the filter's sample period."""

import pytest

from medusa.mc3000.board.registers import FilterBytes, decode_position24, encode_position24


@pytest.mark.parametrize(
    ("counts", "data"),
    [
        (0, "000000"),
        (1, "000001"),
        (-1, "ffffff"),
        (8388607, "7fffff"),
        (-8388608, "800000"),
        (-1234, "fffb2e"),
    ],
)
def test_positions_are_24_bit_twos_complement(counts: int, data: str) -> None:
    assert encode_position24(counts).hex() == data
    assert decode_position24(bytes.fromhex(data)) == counts
    assert encode_position24(counts, lsb_first=True) == bytes.fromhex(data)[::-1]
    assert decode_position24(bytes.fromhex(data)[::-1], lsb_first=True) == counts


@pytest.mark.parametrize("counts", [8388608, -8388609])
def test_a_position_outside_24_bits_is_refused(counts: int) -> None:
    with pytest.raises(ValueError, match=f"position {counts} counts is outside -8388608..8388607"):
        encode_position24(counts)


@pytest.mark.parametrize(("timer", "microseconds"), [(7, 64), (255, 2048), (124, 1000)])
def test_the_sample_period_is_sixteen_clocks_a_step(timer: int, microseconds: int) -> None:
    # Values of the chip's page at 2 MHz.
    assert FilterBytes(0, 0, 0, timer).sample_period(2_000_000) == pytest.approx(
        microseconds * 1e-6, rel=1e-12
    )
