"""``shaftline check``, and the recording that comes with the package."""

from __future__ import annotations

import json
from pathlib import Path

from shaftline.mismatch.example import COLUMN_MAP, CONCEALED, FOLDER, RECORDING
from shaftline.plant import load_ship, write_ship
from shaftline.validation.example import main as write_example

from ..mismatch.recordings.trials import voyage
from ..mismatch.service_logs import service_log
from .conftest import Command


def test_the_command(shaftline: Command, tmp_path: Path) -> None:
    good = shaftline(
        "check",
        FOLDER / RECORDING,
        "--ship",
        "frigate",
        "--columns",
        FOLDER / COLUMN_MAP,
        "--figure",
        tmp_path / "c.png",
        "--json",
        tmp_path / "j.json",
    )
    assert good.exit_code == 0, good.output
    assert (tmp_path / "c.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "j.json").read_text())
    assert any("usable" in sentence for sentence in told["said"])
    bad = shaftline("check", FOLDER / RECORDING, "--ship", "frigate")
    assert bad.exit_code == 2
    assert (
        "column map: check these lines, complete them and use the file with --columns"
        in " ".join(bad.output.split())
    )


def test_a_draft_is_a_toml_file_and_a_recording_has_a_name(
    shaftline: Command, tmp_path: Path
) -> None:
    ask = ["check", FOLDER / RECORDING, "--ship", "frigate"]
    for line, words in (
        (
            [*ask, "--draft", tmp_path / "d.txt"],
            "d.txt: the name of a column map must end in .toml",
        ),
        (["check", "", "--ship", "frigate"], "RECORDING is empty: give the path of one file"),
    ):
        found = shaftline(*line)
        assert found.exit_code == 2
        assert words in " ".join(found.output.split())
    assert not (tmp_path / "d.txt").exists()


def test_a_ship_that_diverges_at_once_is_refused(shaftline: Command, tmp_path: Path) -> None:
    voyage(load_ship("frigate")).to_csv(tmp_path / "v.csv", index=False)
    write_ship(load_ship("frigate").with_values({"hull.mass_kg": 1.0}), tmp_path / "light.toml")
    found = shaftline("check", tmp_path / "v.csv", "--ship", tmp_path / "light.toml")
    assert found.exit_code == 2, found.output
    said = " ".join(found.output.split())
    assert (
        "refused: the nominal ship cannot be simulated with the recorded commands: frigate: the "
        "simulation diverges" in said
    )
    assert "usable" not in said


def test_values_far_beyond_any_bound_are_shown_short_and_warned_of_at_most_once(
    shaftline: Command, tmp_path: Path
) -> None:
    table = voyage(load_ship("frigate"))
    for column in ("shaft_torque_N_m", "fuel_rack_mm"):
        table.assign(**{column: 1e300}).to_csv(tmp_path / "v.csv", index=False)
        found = shaftline("check", tmp_path / "v.csv", "--ship", "frigate")
        assert found.exit_code == 2
        assert "1e+300" in found.output
        assert "0000000000" not in found.output
        assert "overflow" not in found.output


def test_the_example_is_what_its_maker_writes(tmp_path: Path) -> None:
    write_example(tmp_path)
    for path in tmp_path.iterdir():
        assert path.read_text() == (FOLDER / path.name).read_text(), path.name


def test_the_example_names_what_is_concealed(shaftline: Command, tmp_path: Path) -> None:
    found = shaftline("diagnose", "--example", "--out", tmp_path / "ex")
    assert found.exit_code == 0, found.output
    report = json.loads((tmp_path / "ex" / "report.json").read_text())
    sizes = json.loads((FOLDER / CONCEALED).read_text())
    named = {effect["id"] for effect in report["effects"]}
    assert named == set(sizes)
    assert "concealed effect: hull-fouling of 0.1343" in found.output
    for name in (RECORDING, COLUMN_MAP, "ship.toml", "report.html"):
        assert (tmp_path / "ex" / name).is_file()


def test_diagnose_says_what_it_needs(shaftline: Command, tmp_path: Path) -> None:
    for line, words in (
        (("diagnose",), "a RECORDING is needed"),
        (("diagnose", "a.csv"), "--ship is needed"),
        (("diagnose", "a.csv", "--ship", "frigate"), "--out is needed"),
        (("diagnose", "--example", "--ship", "frigate"), "has its own recording"),
    ):
        found = shaftline(*line)
        assert found.exit_code == 2
        assert words in found.output


def test_a_draft_of_the_column_map_is_written_once(shaftline: Command, tmp_path: Path) -> None:
    draft = tmp_path / "map.toml"
    ask = ["check", FOLDER / RECORDING, "--ship", "frigate"]
    first = shaftline(*ask, "--draft", draft)
    assert first.exit_code == 0
    assert "column map: " in first.output
    assert "refused" not in first.output
    assert "usable: " in first.output
    assert shaftline(*ask, "--columns", draft).exit_code == 0
    draft.write_text("mine")
    again = shaftline(*ask, "--draft", draft)
    assert again.exit_code == 2
    assert "the file already exists" in again.output
    assert draft.read_text() == "mine"


def test_a_draft_for_another_logger_works_as_it_is_written(
    shaftline: Command, tmp_path: Path
) -> None:
    table = voyage(load_ship("frigate"))
    table["shaft_torque_N_m"] = table["shaft_torque_N_m"].shift(6).bfill()
    names = {
        "time_s": "t",
        "fuel_rack_mm": "rackPosition_mm",
        "pitch_ratio_command": "pitch_cmd",
        "pitch_ratio": "pitchMeasured",
        "shaft_torque_N_m": "Torque (N·m)",
        "ship_speed_m_s": "speedWater",
    }
    table["propShaft.rpm"] = 9.5493 * table.pop("shaft_speed_rad_s")
    table.rename(columns=names).to_csv(tmp_path / "log.csv", index=False)
    draft = tmp_path / "map.toml"
    ask = ["check", tmp_path / "log.csv", "--ship", "frigate"]
    found = shaftline(*ask, "--draft", draft)
    assert found.exit_code == 0, found.output
    assert shaftline(*ask, "--columns", draft).exit_code == 0
    said = " ".join(found.output.split())
    assert "remark: shaft_torque_N_m lags the simulation by 0.6" in said
    text = draft.read_text(encoding="utf-8")
    assert '"propShaft.rpm" = { column = "shaft_speed_rad_s", unit = "rpm" }\n' in text
    assert "# unit not stated: m/s assumed; knot is also common" in text
    open_map = text.replace('"speedWater"', '# "speedWater"')
    (tmp_path / "part.toml").write_text(open_map, encoding="utf-8")
    more = shaftline(*ask, "--columns", tmp_path / "part.toml", "--draft", tmp_path / "more.toml")
    assert more.exit_code == 0, more.output
    assert "it contains the entries of" in " ".join(more.output.split())
    whole = (tmp_path / "more.toml").read_text()
    assert '"speedWater" = { column = "ship_speed_m_s"' in whole
    assert '"propShaft.rpm" = { column = "shaft_speed_rad_s", unit = "rpm" }\n' in whole
    complete = shaftline(*ask, "--columns", tmp_path / "more.toml")
    assert complete.exit_code == 0, complete.output


def test_rows_of_a_minute_are_usable_as_equilibria(shaftline: Command, tmp_path: Path) -> None:
    log = service_log("frigate", rows=60, interval_s=60.0)
    log.to_csv(tmp_path / "log.csv", index=False)
    ask = ["check", tmp_path / "log.csv", "--ship", "frigate"]
    refused = shaftline(*ask)
    assert refused.exit_code == 2
    assert "use --steady" in " ".join(refused.output.split())
    found = shaftline(*ask, "--steady")
    assert found.exit_code == 0, found.output
    assert "each row is treated as an equilibrium" in " ".join(found.output.split())
    without_rack = log.drop(columns="fuel_rack_mm").assign(time_s=600.0 * log.index)
    without_rack.to_csv(tmp_path / "log.csv", index=False)
    found = shaftline(*ask)
    assert found.exit_code == 0, found.output
    assert "note: the recording has no fuel_rack_mm" in " ".join(found.output.split())
