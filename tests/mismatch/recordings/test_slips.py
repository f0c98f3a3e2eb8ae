"""The slips that a channel is likely to have, and the demands that a ship can be given."""

from __future__ import annotations

import pandas as pd
import pytest

from shaftline.plant import RecordingError

from .conftest import Load


def test_demand_beyond_the_stop_is_refused(load: Load, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"fuel_rack_mm, row 1: 190 mm .* takes 0 to 40 mm"):
        load(calm.assign(fuel_rack_mm=190.0))
