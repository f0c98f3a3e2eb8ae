"""Every command with what it cannot use: exit code 2, a message that names it, nothing left behind.

A row is the command line, and words of the message, which name the reason: a row that is refused for
another one tries nothing.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from shaftline.cli.main import app

pytest.importorskip("stable_baselines3")


def _rows() -> Iterator[tuple[str, str]]:
    for name, words in {
        "nested": "not valid TOML",
        "dotted": "a is not a known key",
        "latin": "cannot be read",
        "digits": "not valid TOML",
        "empty": "missing",
        "folder": "is a folder",
        "fine": "time steps of 1e-09 s",
        "list": "hull.mass_kg",
        "date": "hull.mass_kg",
        "bool": "hull.mass_kg",
        "inf": "hull.mass_kg",
        "pipe": "no ordinary file",
        "zero": "no ordinary file",
        "nowhere": "cannot be read",
    }.items():
        yield f"simulate --ship {name}.toml --case rack_step --out o.csv", words
    for name, words in {
        "pipe": "no ordinary file",
        "zero": "no ordinary file",
        "null": "no ordinary file",
        "empty": "it is empty",
        "one": "is missing",
        "bytes": "bytes.csv",
        "text": "is missing",
        "span": "at most",
        "nan": "nan.csv",
        "twice": "'fuel_rack_mm' occurs twice",
        "nowhere": "cannot be read",
    }.items():
        yield f"simulate --inputs {name}.csv --out o.csv", words
    for place, words in {
        "/dev/null": "no ordinary file",
        "/dev/full": "no ordinary file",
        "pipe.csv": "no ordinary file",
        "folder.toml": "is a folder",
        "/proc/x.csv": "cannot be written",
        "file/x.csv": "is a file",
        "/": "is a folder",
        ".": "is a folder",
        "..": "is a folder",
        "''": "is a folder",
        f"{'x' * 300}.csv": "cannot be",
    }.items():
        yield f"simulate --case rack_step --out {place}", words
        yield f"list --markdown {place}", words
        yield f"list --effects --json {place}", words
        if "folder" not in words:
            why = "too long" if len(place) > 200 else "is a file"
            why = "cannot be written" if place.startswith("/proc") else why
            yield f"evaluate --controller combinator --seeds 1 --out {place}/ev", why
            yield f"validate --cases 1 --out {place}/pr", why
    for place in ("fig", "fig.xyz", "fig.", ".png"):
        yield f"simulate --case rack_step --figure {place}", "a picture file must end in"
    for place in ("/dev/null", "pipe.csv", "folder.toml"):
        yield f"simulate --case rack_step --figure {place}", place
    for name, words in {
        "gamma": "gamma = 5", "rate": "learning_rate = -1", "steps": "steps kept", "net": "net_arch",
        "endless": "max_episode_steps = inf", "long": "from 1 to 10 000 000", "words": "whole number",
        "nan": "gamma = nan", "high": "must be a number", "thin": "refuses the recipe",
        "big": "net_arch = 'big'", "batch": "batch_size = 0", "five": "policy_kwargs = 5",
        "noise": "sensor_noise", "nobody": "unknown observer", "fule": "fule", "tag": "as YAML",
        "list": "no section 'transit'", "deep": "as YAML", "crowd": "n_envs = 100000",
        "minus": "n_timesteps = -5", "pipe": "no ordinary file", "zero": "no ordinary file",
        "nowhere": "cannot be read",
    }.items():  # fmt: skip
        yield f"train --task transit --recipe {name}.yml --out tr", words
    yield "train --task transit --algorithm sac --recipe buffer.yml --out tr", "buffer_size"
    for option, words in {
        "--envs 0": "'--envs'",
        "--envs 1000000000": "--envs",
        "--timesteps -1": "'--timesteps'",
        "--timesteps 0": "'--timesteps'",
        "--seed -1": "'--seed'",
        "--sensor-noise nan": "--sensor-noise",
        "--sensor-noise -1": "--sensor-noise",
        "--observer nobody": "unknown observer",
        "--ship nobody": "unknown ship",
        "--device tpu": "'tpu' is not",
        "--algorithm dqn": "unknown algorithm",
        "--ship kvlcc2": "kvlcc2",
        "--ship folder.toml": "is a folder",
    }.items():
        yield f"train --task transit --out tr {option}", words
    yield "train --task nobody --out tr", "nobody"
    for name, words in {
        "anti-spin:sea_margin=nan": "finite",
        "anti-spin:sea_margin=inf": "finite",
        "anti-spin:sea_margin=1,sea_margin=2": "is given twice",
        "anti-spin:sea_margin": "name=number",
        "anti-spin:=3": "option '' is unknown",
        "anti-spin:nope=3": "nope",
        "combinator:response_s=-1": "response",
        "combinator:response_s=0": "response",
        "policy:junk.npz": "not a policy file",
        "policy:other.npz": "not a policy file",
        "policy:bomb.npz": "unpacks to 200 MB",
        "policy:pipe.npz": "no such policy",
        "policy:zero.npz": "no such policy",
        "policy:nobody": "no such policy",
        "policy:": "unknown controller",
        "nobody:Class": "nobody",
        "os:system": "a class with a method predict",
        "json:loads:x=1": "a class with a method predict",
        "builtins:exec": "a class with a method predict",
        "''": "unknown controller",
        "combinatr": "combinator",
    }.items():
        yield f"evaluate --controller {name} --seeds 1 --episode-s 5 --out ev", words
    for option, words in {
        "--seeds 0": "'--seeds'",
        "--seeds -3": "'--seeds'",
        "--episode-s 1e12": "'--episode-s'",
        "--episode-s nan": "'--episode-s'",
        "--episode-s inf": "'--episode-s'",
        "--episode-s 0": "'--episode-s'",
        "--sea hs=nan,tp=9": "hs",
        "--sea hs=-1,tp=9": "hs",
        "--sea hs=1e9,tp=9": "hs",
        "--sea hs=3": "peak period",
        "--sea state-99": "state-99",
        "--sea hs=3,tp=0": "tp",
        "--sea hs=3,tp=9,xx=1": "xx",
        "--observer nobody": "unknown observer",
        "--jobs 0": "'--jobs'",
        "--jobs -1": "'--jobs'",
        "--backend dask": "--scheduler",
        "--scheduler x": "--backend",
        "--ship rov-thruster": "rov-thruster",
    }.items():
        yield f"evaluate --controller combinator --out ev {option}", words
    for option in ("--cases 0", "--cases -1", "--cases 1000000000000"):
        yield f"validate --out pr {option}", "--cases"
    for option in ("--seed -1", "--variant nobody", "--jobs 0"):
        yield f"validate --cases 1 --out pr {option}", option.split()[0]
    for option, words in {
        "--speed nan": "a speed of nan",
        "--speed -5": "holds a speed of -5 m/s",
        "--drive 1e9": "from 0 to 40",
        "--speed 1e9": "holds a speed of 1e+09 m/s",
        "--speed 0": "holds a speed of 0 m/s",
        "--pitch 99": "--pitch 99",
        "--drive nan": "--drive nan mm: must be",
        "--ship nobody": "unknown ship",
        "--speed 8 --output ''": "give at least one output",
        "": "give either --speed or --drive",
    }.items():
        yield f"linearise --out li {option}", words
    yield "linearise --speed 8 --output nobody --out li", "nobody"
    for option, words in {
        "--speed nan": "a speed of nan",
        "--speed 1e9": "a speed of 1e+09",
        "--interval 0": "--interval 0 s",
        "--interval nan": "--interval nan s",
        "--interval 1e9": "--interval 1e+09 s",
    }.items():
        yield f"loop speed-pilot --out lo {option}", words
    yield "loop speed-pilot --out lo --command nobody", "unknown command"
    yield "loop nobody --out lo", "nobody"
    yield (
        "loop speed-pilot --output nobody --out lo",
        "for a transfer function such as 3,0.4/1,0 only",
    )
    yield "loop 3,0.4/1,0 --output nobody --out lo", "--output nobody: must be one of shaft_speed"
    for option, words in {
        "nobody --speed 7": "unexpected extra argument",
        "--speed 1e9": "a speed of 1e+09",
        "--speed 7": "frigate cannot be steered",
        "--speed 7 --scale 0": "scale",
        "--speed 7 --scale nan": "scale",
        "--speed nan": "a speed of nan",
    }.items():
        own = "frigate" if "steered" in words else "kvlcc2"
        yield f"manoeuvre --ship {own} --out ma {option}", words
    for name, words in {
        "nobody": "unknown table 'nobody'",
        "''": "unknown table ''",
        "all nobody": "unexpected extra argument",
    }.items():
        yield f"reproduce {name} --out re", words
    yield "new-ship --template nobody", "unknown template 'nobody'"
    for place, words in {
        "file": ".toml",
        "empty.toml": "empty.toml",
        "x.txt": ".toml",
        "/dev/null": "/dev/null",
        "folder.toml": "folder.toml",
    }.items():
        yield f"new-ship --template electric-fixed-pitch --out {place}", words
    for option, words in {
        "--vary a": "OPTION=LOW:HIGH",
        "--vary response_s=1": "OPTION=LOW:HIGH",
        "--vary response_s=5:1": "5.0 to 1.0",
        "--vary response_s=nan:2": "nan to 2.0",
        "--vary nope=1:2": "'nope'",
        "--episode-s inf": "'--episode-s'",
        "--episode-s 1e12": "'--episode-s'",
        "--task nobody": "unknown task",
        "--observer nobody": "unknown observer",
    }.items():
        yield f"tune --controller combinator --rounds 1 --seeds 1 {option}", words
    yield "tune --controller combinator --rounds 0", "'--rounds'"
    for option, words in {
        "--vary gamma": "KEY=LOW:HIGH",
        "--vary gamma=": "KEY=LOW:HIGH",
        "--vary =1:2": "KEY=LOW:HIGH",
        "--vary gamma=0.9": "gamma = '0.9'",
        "--vary gamma=nan:1": "gamma = 'nan:1'",
        "--vary gamma=2:1": "gamma = '2:1'",
        "--vary gamma=0.5:5.0": "gamma = 5: must be above 0",
        "--vary gama=0.5:0.9": "unknown key 'gama'",
        "--vary a.b.c=1:2": "unknown key 'a'",
        "--vary n_timesteps=10:20": "cannot be searched",
        "--trials 0": "'--trials'",
        "--vary env_kwargs.max_episode_steps=1:2": "easiest evaluation would win",
        "--seeds 0": "'--seeds'",
        "--vary env_kwargs.sensor_noise=0:1.0": "cannot be searched",
        "--fresh 0": "'--fresh'",
        "--vary gamma=m**9**9,2": "gamma = 'm**9**9'",
        "--vary n_steps=1:1000000000000": "n_steps = 1e+12",
        "--vary learning_rate=1e-9:1e9": "learning_rate = 1e+09",
        "--task nobody": "unknown task",
        "--ship nobody": "unknown ship",
        "--algorithm nobody": "unknown algorithm",
        "--recipe deep.yml": "nested too deeply",
        "--recipe zero.toml": "no ordinary file",
        "--envs 0": "'--envs'",
    }.items():
        yield f"tune-recipe {option} --out ts", words
    yield "tune-recipe --out file", "is a file"
    yield "tune --controller nobody --rounds 1 --seeds 1", "nobody"
    unreadable = {
        "empty": "it is empty",
        "bytes": "bytes that are no text",
        "zero": "no ordinary file",
        "pipe": "no ordinary file",
        "nowhere": "no such file",
    }
    maps = {
        "unit": "an exponent is one number",
        "deep-map": "nested too deeply",
        "pipe": "no ordinary",
        "zero": "no ordinary file",
    }
    for option, words in {
        **{f"{name}.csv": why for name, why in unreadable.items()},
        "folder.toml": "no recording in this folder",
        "ok.csv --effects term.toml": "balance is missing",
        "ok.csv --effects code.toml": "__import__",
        "ok.csv --effects zero.toml": "no ordinary file",
        **{f"ok.csv --columns {name}.toml": why for name, why in maps.items()},
        "ok.csv --tolerance nan": "'--tolerance'",
        "ok.csv --tolerance -1": "'--tolerance'",
        "measured.csv --hold-out nowhere.csv": "nowhere.csv",
        "ok.csv --exclude nobody": "unknown effect",
    }.items():
        yield f"diagnose {option} --ship frigate --out di", words
    yield "diagnose ok.csv --ship zero.toml --out di", "no ordinary file"
    yield "diagnose --example --ship frigate --out di", "has its own recording"
    yield "diagnose --example --out file", "is a file"
    for option, words in {
        **{f"{name}.csv": why for name, why in unreadable.items()},
        "span.csv": "shaft_speed_rad_s",
        "endless.csv": "not a finite number",
        "text.csv": "is missing",
        "twice.csv": "'fuel_rack_mm' occurs twice",
        "book.xlsx": "no spreadsheet",
        "bomb.xlsx": "unpacks to 600 MB",
        "ok.csv --figure fig": "a picture file must end in",
        "ok.csv --figure null.png": "no ordinary file",
        "ok.csv --columns unit.toml": maps["unit"],
        "ok.csv --columns zero.toml": maps["zero"],
        "ok.csv --columns separator.toml": "file.separator",
        "ok.csv --columns row.toml": "line 900",
    }.items():
        yield f"check {option} --ship frigate", words
    for option, words in {
        "ok.csv --free nobody": "nobody is no parameter of this ship",
        "ok.csv --method magic": "unknown method",
        "empty.csv": "it is empty",
        "twice.csv": "'fuel_rack_mm' occurs twice",
        "ok.csv --tolerance nan": "'--tolerance'",
    }.items():
        yield f"identify {option} --ship frigate --out id", words
    yield "simulate --ship utf16.toml --case rack_step --out o.csv", "not UTF-8 text"
    for option, words in (
        ("loop.csv", "symbolic links"),
        ("wide.csv", "first line is longer"),
        ("three.csv", "at least 10 are needed"),
    ):
        yield f"diagnose {option} --ship frigate --out di", words
    yield "check three.csv --ship frigate", "at least 40 are needed"
    for place in ("/dev/null", "pipe.toml", "folder.toml", "/proc/x.toml", "file/x.toml"):
        yield f"check ok.csv --ship frigate --draft {place}", place.split("/x")[0]
    for sea, words in {
        "--hs 2.5": "--hs and --tp must be given together",
        "--tp 8": "--hs and --tp must be given together",
        "--hs nan --tp 8": "significant wave height",
        "--hs -1 --tp 8": "significant wave height",
        "--hs 99 --tp 8": "significant wave height",
        "--hs 2 --tp inf": "peak period",
    }.items():
        yield f"simulate --case jonswap {sea} --out o.csv", words
        yield f"evaluate --controller combinator --seeds 1 --out e {sea}", words
    for command in (
        "evaluate --controller combinator --out ev",
        "tune --controller va-pitch",
    ):
        yield f"{command} --seeds 1000000000", "equal to 10000"
    yield "simulate --case jonswap --hs 2 --tp 8 --sea calm --out o.csv", "give either --sea or"
    yield "linearise --speed 8 --pitch 99 --out li", "P/D of frigate must be from 0.6 to 1.4"
    for law in ("1e400/1", "1/0", ",/,", "nan/1"):
        yield f"loop {law} --out lo", "must be numerator/denominator"
    yield "loop 3,0.4/1,0 --pitch 0.1 --out lo", "P/D of frigate must be from 0.6 to 1.4"
    yield "evaluate --controller nobody:x --task transit --seeds 1 --out ev", "nobody:x: cannot"
    for line in (
        "simulate --inputs ok.csv --out ok.csv",
        "simulate --inputs ok.csv --out damaged/../ok.csv",
        "check ok.csv --ship frigate --json ok.csv",
        "check ok.csv --ship light.toml --json light.toml",
        "diagnose ok.csv --ship corrected_ship.toml --json corrected_ship.toml --out di",
        "linearise --ship corrected_ship.toml --speed 7 --out li --json corrected_ship.toml",
        "loop speed-pilot --ship corrected_ship.toml --out lo --json corrected_ship.toml",
        "train --recipe rate.yml --out tr --json rate.yml",
    ):
        yield line, "would be replaced"
    yield (
        "diagnose ok.csv --ship corrected_ship.toml --out .",
        "would replace --ship corrected_ship.toml",
    )
    for name, words in {
        "obeyed": "contains control characters",
        "lines": "contains control characters",
        "nameless": "at least 1 character",
        "endless-name": "at most 100 characters",
        "light": "hull.mass_kg = 1e-300",
    }.items():
        yield f"linearise --ship {name}.toml --speed 7 --out li", words
    for name, words in {
        "zip": "'zip' is no known encoding",
        "rot13": "'rot13' is no known encoding",
        "commas": "separator and decimal are both",
    }.items():
        yield f"check ok.csv --ship frigate --columns {name}.toml", words
    for name, words in {
        "constant": "it must add 0 there",
        "tower": "no finite number",
        "root": "no finite number",
        "attribute": "is not allowed in an expression",
        "lambda": "is not allowed in an expression",
    }.items():
        yield f"diagnose ok.csv --ship frigate --effects {name}-term.toml --out di", words
    yield "simulate --inputs switch.csv --out o.csv", "True is not a finite number"
    yield "train --task transit --out damaged", "training.json: damaged, not valid JSON"
    yield "nobody", "No such command"
    yield "simulate --nobody", "No such option"


ROWS = list(_rows())


def _contents(folder: Path) -> dict[str, bytes | None]:
    """What stands in a folder and below; nothing is asked of links, devices and pipes."""
    return {
        str(path): path.read_bytes() if path.is_file() and not path.is_symlink() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.mark.parametrize(("line", "words"), ROWS, ids=[line[:70] for line, _ in ROWS])
def test_is_refused(
    line: str, words: str, hostile: Path, mark: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(hostile)
    before = _contents(hostile)
    devices = [os.stat(name).st_rdev for name in ("/dev/null", "/dev/full", "/dev/zero")]
    result = CliRunner().invoke(app, shlex.split(line))
    assert isinstance(result.exception, SystemExit), repr(result.exception)
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert _contents(hostile) == before
    assert [os.stat(name).st_rdev for name in ("/dev/null", "/dev/full", "/dev/zero")] == devices
    assert not mark.exists()


def test_every_row_names_its_reason() -> None:
    assert [line for line, words in ROWS if not words] == []


def test_none_of_them_is_left_out() -> None:
    assert len(ROWS) >= 290
