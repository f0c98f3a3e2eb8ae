"""Version, dependencies and checks are told alike wherever they are told."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PINS = dict(re.findall(r"^([\w.-]+)==(\S+)", (ROOT / "constraints.txt").read_text(), re.MULTILINE))


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_package_citation_and_changelog_tell_one_release() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    heads = re.findall(
        r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$",
        (ROOT / "CHANGELOG.md").read_text(),
        re.MULTILINE,
    )
    assert (citation["version"], str(citation["date-released"])) == heads[0]
    assert SETTINGS["project"]["version"] == citation["version"]
    assert [date for _, date in heads] == sorted((date for _, date in heads), reverse=True)


def test_every_dependency_is_pinned() -> None:
    extras = SETTINGS["project"]["optional-dependencies"]
    tested = [*SETTINGS["project"]["dependencies"], *extras["dev"]]
    for extra in re.findall(r"shaftline\[([\w,]+)\]", " ".join(extras["dev"]))[0].split(","):
        tested += extras[extra]
    names = {normal(re.split(r"[\[<>=~ ]", one)[0]) for one in tested} - {"shaftline"}
    assert names <= {normal(name) for name in PINS}


def test_every_hook_of_ruff_has_the_pinned_version() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    revisions = [repo["rev"] for repo in hooks["repos"] if "ruff" in repo["repo"]]
    assert revisions == [f"v{PINS['ruff']}"]


def test_hosted_checks_are_those_of_a_fresh_clone() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    job = workflow["jobs"]["ci"]
    steps = [step["run"] for step in job["steps"] if "run" in step]
    assert steps == re.findall(r"^make .+$", (ROOT / ".ci/run").read_text(), re.MULTILINE)
    oldest = SETTINGS["project"]["requires-python"].removeprefix(">=")
    assert oldest in job["strategy"]["matrix"]["python"]
