"""A diagnosis as plain text."""

from __future__ import annotations

from dataclasses import replace

from shaftline.mismatch.report.text import align_columns, summary

from ..diagnoses import candidate, diagnosis_of


def test_columns_are_aligned_under_their_heads() -> None:
    rows = [
        {"name": "a", "value": "1.0", "note": ""},
        {"name": "long one", "value": "10.0", "note": "x"},
    ]
    assert align_columns(rows, ["value"]) == (
        "name      value  note\na           1.0\nlong one   10.0  x"
    )
    assert align_columns([]) == ""


def test_a_summary_has_answer_findings_fit_and_notes() -> None:
    found = diagnosis_of("explained", limits=["insufficient excitation: a"], warnings=["b"])
    finding = replace(
        found.findings[0],
        rivals=(
            candidate("viscous-friction (engine)", 343.0, 700.0),
            candidate("coulomb-friction (engine)", 340.0, 1.0),
        ),
    )
    text = summary(replace(found, findings=[finding]))
    assert text == "\n".join(
        [
            "Explained by Coulomb friction.",
            "",
            "Missing physics (evidence: log-likelihood-ratio statistic, 2 Δ log L)",
            "effect            balance  parameter                         value  95 % from    to  unit"
            "  evidence  threshold  indistinguishable from",
            "coulomb-friction  engine   coulomb_friction_engine_side_N_m   8000       6950  9050  N m"
            "      347.0       10.5  viscous-friction (engine)",
            "",
            "In words",
            found.sentence,
            "",
            "Fit of the ship file (before) and of the corrected ship (after), simulated open loop; "
            "FitPercent: 100 is perfect",
            "channel            before  after  rms before  rms after  unit",
            "pitch_ratio          84.5   99.4           0          0",
            "shaft_speed_rad_s    84.5   99.4         0.3          0  rad/s",
            "evaluated on 180 to 240 s, which was held out before anything was fitted",
            "",
            "note: insufficient excitation: a",
            "note: b",
        ]
    )


def test_the_second_parameter_stands_below_the_first() -> None:
    found = diagnosis_of("explained")
    two = replace(found.findings[0], estimates=found.findings[0].estimates * 2)
    lines = summary(replace(found, findings=[two])).splitlines()
    first, second = (line for line in lines if "coulomb_friction_engine_side" in line)
    assert first.startswith("coulomb-friction  engine")
    assert second.split() == ["coulomb_friction_engine_side_N_m", "8000", "6950", "9050", "N", "m"]


def test_a_constant_channel_says_so() -> None:
    found = diagnosis_of(
        "nothing-missing", fit_before={"pitch_ratio": 84.5}, fit_after={"pitch_ratio": 99.4}
    )
    lines = summary(found).splitlines()
    (line,) = (line for line in lines if line.startswith("shaft_speed_rad_s"))
    assert line.split(maxsplit=6) == [
        "shaft_speed_rad_s",
        "–",
        "–",
        "0.3",
        "0",
        "rad/s",
        "constant: no FitPercent",
    ]
    assert "Missing physics" not in summary(found)
    assert "note:" not in summary(found)
