"""What a careful reader is told beside the verdict."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.report.text import remarks
from shaftline.mismatch.search.fitting import Colour

from ..diagnoses import TIME, channels, diagnosis_of


def test_a_correction_that_does_harm_is_said_to() -> None:
    worse = dict.fromkeys(channels(0.0), -20.0)
    (said,) = remarks(diagnosis_of("unexplained", fit_after=worse))
    assert "worse than the nominal ship does" in said


def test_what_acts_only_on_the_part_set_aside_is_said() -> None:
    residual = diagnosis_of("nothing-missing").residual_before.copy()
    residual[1] = 300.0 * np.sin(TIME) - 9000.0 * (TIME > 200.0)
    (said,) = remarks(diagnosis_of("nothing-missing", residual_after=residual))
    assert said.startswith("In the engine balance the residual is")
    assert "times as large on the held-out data" in said


def test_what_a_finding_leaves_is_said() -> None:
    (said,) = remarks(diagnosis_of("explained", left_over=Colour(0, 1, 0.005, 0.02, 14.0)))
    assert "residual has 14 times the noise's power between 0.0050 and 0.020 Hz" in said


@pytest.mark.parametrize(("after", "said"), [(83.49, True), (83.51, False)])
def test_a_point_of_fit_may_be_lost_without_a_word(after: float, said: bool) -> None:
    found = remarks(
        diagnosis_of("explained", fit_after={"pitch_ratio": after, "shaft_speed_rad_s": 99.0})
    )
    assert bool(found) is said
    if said:
        assert "fits pitch ratio worse" in found[0]


@pytest.mark.parametrize(("factor", "said"), [(3.1, True), (2.9, False)])
def test_three_times_as_much_elsewhere_is_said(factor: float, said: bool) -> None:
    residual = diagnosis_of("nothing-missing").residual_before.copy()
    # means over 4 s, in turn above, on and below a level, and further from it on the part set aside
    around = np.resize(np.repeat([100.0, 0.0, -100.0], 20), len(TIME))
    residual[1] = -7000.0 + around * np.where(np.arange(len(TIME)) >= 900, factor, 1.0)
    found = remarks(diagnosis_of("nothing-missing", residual_after=residual))
    assert (
        bool([text for text in found if "engine balance the residual is 3 times" in text]) is said
    )


def test_where_the_correction_does_harm_the_places_are_not_told() -> None:
    residual = diagnosis_of("nothing-missing").residual_before.copy()
    residual[1] = 300.0 * np.sin(TIME) - 9000.0 * (TIME > 200.0)
    worse = dict.fromkeys(channels(0.0), -20.0)
    assert len(remarks(diagnosis_of("unexplained", residual_after=residual, fit_after=worse))) == 1


def test_what_no_finding_leaves_is_not_said() -> None:
    assert remarks(diagnosis_of("unexplained")) == []
