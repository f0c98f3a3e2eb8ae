"""Fouling beside a wrong torque meter, a turn and slow inflow: the recording, and the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reproductions import concealed_turn as case
from shaftline.plant import Schedule, equilibrium, load_ship, simulate
from shaftline.plant.hull import resistance


def test_the_recording_has_the_concealed_effects() -> None:
    """Without noise and inflow, the first row is the equilibrium of the fouled ship."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case, "NOISE", {})
        patch.setattr(case, "INFLOW_M_S", 0.0)
        table = case.make_recording(21)
    assert len(table) == 3600
    assert "rudder_command_rad" not in table
    turning = np.abs(table["rudder_rad"]) > np.radians(10.0)
    assert case.INTERVAL_S * turning.sum() == pytest.approx(case.TURN_S, abs=5.0)
    ship, first = load_ship(case.SHIP), table.iloc[0]
    commands = float(first["fuel_rack_mm"]), float(first["pitch_ratio_command"])
    fouled = equilibrium(ship, *commands, resistance_factor=1.09)
    assert first["ship_speed_m_s"] == pytest.approx(fouled.state.ship_speed, rel=1e-6)
    start = simulate(ship, Schedule(*commands, resistance_factor=1.09), 1.0, initial=fouled.state)
    assert first["shaft_torque_N_m"] == pytest.approx(1.03 * start["shaft_torque"][0], rel=1e-6)


def test_the_drag_of_the_wind_slows_the_ship(monkeypatch: pytest.MonkeyPatch) -> None:
    """In steady wind the first row is the equilibrium with the drag as added resistance."""
    monkeypatch.setattr(case, "NOISE", {})
    monkeypatch.setattr(case, "INFLOW_M_S", 0.0)
    monkeypatch.setattr(case, "GUST_M_S", 0.0)
    monkeypatch.setattr(case, "DRAG", (0.7,) * len(case.DRAG))
    calm, windy = case.make_recording(21).iloc[0], case.make_recording(21, windy=True).iloc[0]
    seen, angle = windy["wind_speed_m_s"], windy["wind_angle_rad"]
    blows = np.hypot(seen * np.cos(angle) - windy["ship_speed_m_s"], seen * np.sin(angle))
    assert case.WIND_M_S[0] <= blows <= case.WIND_M_S[1]
    record = load_ship(case.SHIP).record()
    extra = case.AIR * 0.7 * seen**2 / resistance(record, windy["ship_speed_m_s"], 1.0)
    commands = float(windy["fuel_rack_mm"]), float(windy["pitch_ratio_command"])
    blown = equilibrium(load_ship(case.SHIP), *commands, resistance_factor=1.09 + extra)
    assert windy["ship_speed_m_s"] == pytest.approx(blown.state.ship_speed, rel=1e-4)
    assert windy["ship_speed_m_s"] < calm["ship_speed_m_s"]


def test_the_page_counts_what_is_named_beside_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def result_of(cell: tuple[int, bool]) -> dict[str, Any]:
        seed, _ = cell
        wrong = "propeller-walk" if seed == 2 else "–"
        return {"seed": seed, "verdict": "x", "others named": wrong, "inside": seed != 3}

    monkeypatch.setattr(case, "diagnose_recording", result_of)
    folders = ["--out", str(tmp_path), "--kept", str(tmp_path / "kept")]
    case.main(["--seeds", "1", "2", "3", *folders])
    text = " ".join((tmp_path / "concealed-turn.md").read_text(encoding="utf-8").split())
    assert "inside the intervals in 4 of 6 recordings. In 2 of them" in text
    assert "`python -m reproductions concealed_turn --out docs/results --seeds 1 2 3`" in text
