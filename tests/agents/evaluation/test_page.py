"""The page of an evaluation: equal rows once, zero columns named, intervals where there are any."""

from __future__ import annotations

from typing import Any

import pandas as pd

from shaftline.agents import KPIS
from shaftline.agents.evaluation.page import merge_equal_rows, page


def row(controller: str, sea: str, observer: str, **values: float) -> dict[str, Any]:
    kpis = dict.fromkeys(KPIS, 1.0) | {"overspeed_s": 0.0} | values
    ends = {f"{name}{end}": kpis[name] for name in KPIS for end in ("_low", "_high")}
    return {"controller": controller, "sea": sea, "observer": observer, **ends, **kpis}


TABLE = pd.DataFrame(
    [
        row("lever", "calm", "none"),
        row("lever", "calm", "oracle"),
        row("lever", "calm", "luenberger"),
        row("pilot", "calm", "none", reward=2.0),
        row("pilot", "calm", "oracle", reward=2.0),
        row("pilot", "calm", "luenberger", reward=3.0) | {"reward_low": 2.5, "reward_high": 3.25},
        row("lever", "state-5", "none", overspeed_s=0.0),
    ]
)


def test_rows_of_equal_figures_are_joined() -> None:
    found = merge_equal_rows(TABLE)
    assert found[["controller", "sea", "observer"]].to_numpy().tolist() == [
        ["lever", "calm", "any"],
        ["pilot", "calm", "none, oracle"],
        ["pilot", "calm", "luenberger"],
        ["lever", "state-5", "none"],
    ]
    alone = merge_equal_rows(TABLE[TABLE["observer"] == "none"])
    assert alone["observer"].tolist() == ["none"] * 3  # of one observer there is no `any`


def test_a_page_has_a_section_a_sea_and_says_what_is_zero() -> None:
    text = page(TABLE, "Trial", ["reward", "overspeed_s"])
    assert text.startswith("# Trial\n\nInterquartile mean over the episodes")
    calm, rough = text.split("## Sea: calm")[1].split("## Sea: state-5")
    assert [line.split() for line in calm.strip().splitlines()[2:]] == [
        ["|", "lever", "|", "any", "|", "1.00", "|"],
        ["|", "pilot", "|", "none,", "oracle", "|", "2.00", "|"],
        ["|", "pilot", "|", "luenberger", "|", "3.00", "(2.50", "to", "3.25)", "|"],
    ]
    assert "| controller | observer | reward |" in calm
    assert "lever" in rough
    assert "pilot" not in rough
    assert "Zero everywhere: `overspeed_s`." in text
    assert "Observer `any`: the figures are the same with each of the 3 observers" in text
    assert text.endswith(
        "- `reward`: sum of the rewards of the task, 0 where the episode failed; higher is better\n"
        "- `overspeed_s`: time beyond the engine's highest speed [s]\n"
    )


def test_a_plain_page_has_no_notes() -> None:
    text = page(TABLE[3:6], "Trial", ["reward"])
    assert "Zero everywhere" not in text
    assert "`any`" not in text
