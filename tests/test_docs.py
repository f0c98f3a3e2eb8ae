"""The Python blocks of README and docs run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shaftline.observers import readings_of
from shaftline.plant import Schedule, equilibrium, load_ship, simulate

ROOT = Path(__file__).parents[1]
BLOCKS = [
    (page.relative_to(ROOT).as_posix(), i, block)
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    for i, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL))
]


@pytest.mark.parametrize(
    ("page", "number", "block"), BLOCKS, ids=[f"{p}-{i}" for p, i, _ in BLOCKS]
)
def test_python_block_runs(page: str, number: int, block: str) -> None:
    # what a page may take for granted: a ship, its readings and their time step
    ship = load_ship("frigate")
    run = simulate(ship, Schedule(22.0, 1.3), 10.0, initial=equilibrium(ship, 22.0, 1.4).state)
    exec(block, {"ship": ship, "readings": readings_of(run), "dt": ship.time_step_s})


def test_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page}: {target}"
