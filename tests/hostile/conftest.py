"""A folder of hostile files, made once."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

SHIP = Path(__file__).parents[2] / "plant/ships/frigate.toml"
TRAINING = "transit:\n  n_envs: 4\n  n_timesteps: 64\n"
_TERM = """[[term]]
id = "mine"
balance = "hull"
acts_on = "resistance"
expression = "{expression}"
parameters = {{ k = {{ unit = "N", probes = [1.0] }} }}
"""
HEAD = "time_s,fuel_rack_mm,pitch_ratio_command\n"


def _texts(mark: Path) -> dict[str, str]:
    ship = SHIP.read_text(encoding="utf-8")
    mass = "mass_kg = 3.3e6"
    recipes = {
        "gamma": "gamma: 5",
        "rate": "learning_rate: -1",
        "steps": "n_steps: 1000000000",
        "net": "policy_kwargs: {net_arch: [1000000, 1000000]}",
        "endless": "env_kwargs: {max_episode_steps: .inf}",
        "long": "env_kwargs: {max_episode_steps: 1000000000000}",
        "words": "env_kwargs: {max_episode_steps: long}",
        "nan": "gamma: .nan",
        "high": "gamma: high",
        "thin": "policy_kwargs: {net_arch: [-3]}",
        "big": "policy_kwargs: {net_arch: big}",
        "batch": "batch_size: 0",
        "five": "policy_kwargs: 5",
        "noise": "env_kwargs: {sensor_noise: .nan}",
        "nobody": "env_kwargs: {observer: nobody}",
        "fule": "weights: {fule: 1}",
        "buffer": "buffer_size: 1000000000000",
    }
    return {
        "nested.toml": "a = " + "[" * 20000 + "]" * 20000,
        "dotted.toml": "a." * 5000 + "b = 1",
        "digits.toml": ship.replace("3.3e6", "9" * 5000),
        "empty.toml": "",
        "fine.toml": ship + "\n[integration]\ntime_step_s = 1e-9\n",
        "list.toml": ship.replace(mass, "mass_kg = [1.0]"),
        "date.toml": ship.replace(mass, "mass_kg = 1979-05-27"),
        "bool.toml": ship.replace(mass, "mass_kg = true"),
        "inf.toml": ship.replace(mass, "mass_kg = inf"),
        "term.toml": '[[term]]\nid = "x"\n',
        "code.toml": '[[term]]\nid = "x"\nbalance = "hull"\nacts_on = "resistance"\nexpression = "'
        f"k * __import__('os').system('touch {mark}')\"\n"
        "parameters = { k = { probes = [1.0] } }\n",
        "unit.toml": '[columns]\nt = {column = "time_s", unit = "m**9**9**9**9/s"}\n',
        "deep-map.toml": "x = " + "{a=" * 3000 + "1" + "}" * 3000,
        "separator.toml": '[file]\nseparator = "abc"\n',
        "row.toml": "[file]\nheader_row = 900\n",
        "book.xlsx": "no book",
        "empty.csv": "",
        "one.csv": "time_s\n",
        "text.csv": "hello\nworld\n",
        "ok.csv": HEAD + "".join(f"{0.1 * i:.1f},20,1.2\n" for i in range(50)),
        "corrected_ship.toml": ship,
        "dotted-name.toml": ship.replace('"frigate"', '"../../evil.so"'),
        "obeyed.toml": ship.replace('"frigate"', '"\\u001b[2J"'),
        "lines.toml": ship.replace('"frigate"', '"a\\nb"'),
        "nameless.toml": ship.replace('"frigate"', '""'),
        "endless-name.toml": ship.replace('"frigate"', f'"{"x" * 100_000}"'),
        "light.toml": ship.replace(mass, "mass_kg = 1e-300"),
        "zip.toml": '[file]\nencoding = "zip"\n',
        "rot13.toml": '[file]\nencoding = "rot13"\n',
        "commas.toml": '[file]\nseparator = ","\ndecimal = ","\n',
        **{
            f"{name}-term.toml": _TERM.format(expression=expression)
            for name, expression in {
                "constant": "k + 5",
                "tower": "k * 9 ** 9 ** 9 ** 9",
                "root": "k * log(-1 - abs(time))",
                "attribute": "k * time.__class__",
                "lambda": "k * (lambda: 1)()",
            }.items()
        },
        "switch.csv": HEAD + "".join(f"{0.1 * i:.1f},True,1.2\n" for i in range(50)),
        "measured.csv": "time_s,fuel_rack_mm,pitch_ratio_command,shaft_speed_rad_s\n"
        + "".join(f"{0.1 * i:.1f},{20 + i % 7},1.2,{9.8 + 0.01 * (i % 5)}\n" for i in range(200)),
        "endless.csv": "time_s,fuel_rack_mm,pitch_ratio_command,shaft_speed_rad_s\n"
        + "".join(f"{0.1 * i:.1f},{'inf' if i == 7 else 20},1.2,9.8{i % 5}\n" for i in range(200)),
        "three.csv": "time_s,fuel_rack_mm,pitch_ratio_command,shaft_speed_rad_s\n"
        + "".join(f"{0.1 * i:.1f},20,1.2,{9.8 + 0.01 * i}\n" for i in range(3)),
        "span.csv": HEAD + "0,20,1.2\n1e12,20,1.2\n2e12,20,1.2\n",
        "nan.csv": HEAD + "0,20,1.2\n1,nan,1.2\n2,20,1.2\n",
        "twice.csv": "time_s,fuel_rack_mm,fuel_rack_mm,pitch_ratio_command\n0,20,20,1.2\n1,20,20,1.2\n",
        "file": "x",
        "tag.yml": f"transit: !!python/object/apply:os.system ['touch {mark}']\n",
        "list.yml": "- 1\n- 2\n",
        "deep.yml": "transit: " + "[" * 5000 + "]" * 5000,
        "crowd.yml": "transit:\n  n_envs: 100000\n  n_timesteps: 64\n",
        "minus.yml": "transit:\n  n_envs: 4\n  n_timesteps: -5\n",
        "junk.npz": "PK junk",
        **{f"{name}.yml": f"{TRAINING}  {line}\n" for name, line in recipes.items()},
    }


@pytest.fixture(scope="session")
def mark(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What appears where a file's code was run."""
    return tmp_path_factory.mktemp("mark") / "ran"


@pytest.fixture(scope="session")
def hostile(tmp_path_factory: pytest.TempPathFactory, mark: Path) -> Path:
    """The folder."""
    folder = tmp_path_factory.mktemp("hostile")
    for name, text in _texts(mark).items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "loop.csv").symlink_to("loop.csv")
    (folder / "wide.csv").write_text(",".join(f"c{k}" for k in range(50_000)))
    (folder / "utf16.toml").write_bytes("name = 'caf\u00e9'".encode("utf-16"))
    (folder / "latin.toml").write_bytes(b"name = 'caf\xe9'")
    (folder / "bytes.csv").write_bytes(np.random.default_rng(0).bytes(5000))
    (folder / "folder.toml").mkdir()
    for ending in ("toml", "csv", "yml", "npz"):
        os.mkfifo(folder / f"pipe.{ending}")
        (folder / f"zero.{ending}").symlink_to("/dev/zero")
    for name in ("null.csv", "null.png"):
        (folder / name).symlink_to("/dev/null")
    np.savez(folder / "other.npz", a=np.arange(3))
    (folder / "damaged").mkdir()
    (folder / "damaged" / "training.json").write_text("{")
    with (
        zipfile.ZipFile(folder / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as file,
        file.open("about.npy", "w") as member,
    ):
        for _ in range(200):
            member.write(bytes(1_000_000))
    with (
        zipfile.ZipFile(folder / "bomb.xlsx", "w", zipfile.ZIP_DEFLATED) as file,
        file.open("xl/worksheets/sheet1.xml", "w", force_zip64=True) as member,
    ):
        for _ in range(600):
            member.write(bytes(1_000_000))
    return folder
