"""Records that must not change unless someone means it: every signal of every scenario.

`python tests/golden/make.py records` writes their projections again, for a change that is meant.
"""

import pytest

from tests.golden import contents

ADVICE = "if that is meant: python tests/golden/make.py records"


# A second and more each, with a friction, a drive or a motion that others have as well.
LIKE_OTHERS = {
    "coulomb-v1", "coulomb_fc_step-v1", "coulomb_ja_step-v1", "coulomb_kg_step-v1",
    "coulomb_kt_step-v1", "encoder_coulomb_fm_step-v1", "wg_warming-v1",
    "coulomb_moves_fm_step-v1", "warming_coulomb-v1", "wg_ja_step-v1",
    "real_coulomb_fm_step-v1", "coarse_encoder_coulomb_fm_step-v1", "wg_kg_step-v1",
    "wg_kt_step-v1", "appearing_fc_step-v1", "bench_fm_step-v1", "coulomb_fm_step-v1",
    "temperature_fm_step-v1", "gone_fc_step-v1", "erob80_100_fm_step-v1", "real_lugre_fm_step-v1",
    "rest_coulomb_fm_step-v1", "erob80_50_fm_step-v1", "sticking_fm_step-v1", "sts3215_kt_step-v1",
    "xl320_fm_step-v1", "mx64_fc_step-v1", "mx106_ja_step-v1", "xl330_appearing_fc_step-v1",
    "warming_fm_step-v1", "pause_fm_step-v2", "bench_kg_step-v1", "control_fc_multisine-v1",
    "control_wg_kt_moves-v1", "coulomb_fc_step-v2", "erob80_100_kt_step-v1",
    "erob80_50_ja_step-v1", "mx106_fm_step-v1", "mx64_kg_step-v1", "xl320_kt_step-v1",
    "ja_ramp-v1", "kt_ramp-v1",
}  # fmt: skip
OLD = contents.golden_records()


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n in LIKE_OTHERS)) for n in contents.recorded()],
)
def test_a_record_is_what_it_was(name):
    moved = contents.record_moves(OLD[name], contents.projections(name))
    assert not moved, "\n".join([ADVICE, *moved])


def test_the_file_holds_no_other_scenario():
    assert sorted(OLD) == sorted(contents.recorded()), ADVICE
