"""Provide a small challenge for practice: six cases with one row a second, and their truth.

The seed is the smallest one whose six cases include every kind of case and both ships. No result of a
tool took part in the choice. ``python -m shaftline.validation.practice FOLDER`` makes the set again.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from ..core.files import read_text, write_text
from .challenge import CARD, make_challenge, refuse_content, truth_file
from .variants import SLOW

FOLDER = Path(__file__).parent / "challenge_set" / "challenge"
"""Folder of the challenge; the truth is the file beside it."""

SEED, CASES, VARIANT = 17, 6, SLOW

PRACTICE = f"""
**Practice set.** This challenge belongs to the package shaftline, and its truth is public: seed {SEED},
{CASES} cases, variant {VARIANT}. Use it to try tools, not to compare them. For a comparison make a
challenge with a seed of your own.
"""


def make_set(folder: Path, jobs: int | None = None) -> None:
    """Make the set again, with its truth beside the folder.

    Args:
        folder: new or empty folder.
        jobs: processes, by default one for each core.
    """
    make_challenge(folder, SEED, CASES, VARIANT, jobs=jobs)
    write_text(folder / CARD, read_text(folder / CARD) + PRACTICE)


def copy_set(folder: Path) -> Path:
    """Copy the set and its truth; return the file of the truth, beside the folder.

    Args:
        folder: new or empty folder.

    Raises:
        ValueError: the folder has content, or the truth exists.
    """
    truth = truth_file(folder)
    refuse_content(folder, truth)
    shutil.copytree(FOLDER, folder, dirs_exist_ok=True)
    shutil.copyfile(truth_file(FOLDER), truth)
    return truth


if __name__ == "__main__":
    make_set(Path(sys.argv[1]))
