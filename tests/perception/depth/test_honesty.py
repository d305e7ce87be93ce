"""The stated deviation against the true errors on rendered scenes: the issue's 60–76 % and 91–98 %."""

from statistics import mean

import pytest

from perception.depth.settings import DEFAULT
from tools.depth.score import run_sequence, score_map
from tools.depth_scenes import Sequence, sea_bed, slanted_plane, table_top

SCENES = {
    "plane": lambda: slanted_plane(),
    "plane with noise": lambda: slanted_plane(noise=2.0),
    "table-top": lambda: table_top(),
    "sea bed": lambda: sea_bed(),
}


@pytest.mark.parametrize("name", SCENES)
def test_intervals_of_68_and_95_per_cent_cover_what_they_say_over_the_sequence(name: str) -> None:
    sequence: Sequence = SCENES[name]()
    maps = run_sequence(sequence, DEFAULT)
    scores = [score_map(found, truth) for found, truth in zip(maps, sequence.truth[1:], strict=True)]
    # maps of one size: the mean of their coverages is that of all their errors
    assert 60 <= mean(score.cover_68 for score in scores) <= 76
    assert 91 <= mean(score.cover_95 for score in scores) <= 98
