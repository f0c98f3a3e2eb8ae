"""Effects with values."""

from __future__ import annotations

import pytest

from shaftline.mismatch.search.catalogue import SizedEffect

from ..toy import entry

BEND = entry("engine-torque-curvature (engine)")


def test_values_stand_beside_their_parameters() -> None:
    placed = SizedEffect(BEND, (-1.5, 70.0))
    assert [(p.name, value) for p, value in placed.pairs] == [
        ("torque_curvature_N_m_s2_rad2", -1.5),
        ("torque_curvature_speed_rad_s", 70.0),
    ]
    with pytest.raises(ValueError, match="zip"):
        _ = SizedEffect(BEND, (-1.5,)).pairs


def test_other_values_keep_effect_and_window() -> None:
    episode = SizedEffect(entry("resistance-episode (hull)"), (0.5,), (60.0, 150.0))
    other = episode.with_values([1])
    assert other == SizedEffect(episode.effect, (1.0,), (60.0, 150.0))
    assert isinstance(other.values[0], float)
