"""Fixtures of the package's tests, for the tests of the reproductions."""

from __future__ import annotations

from tests.conftest import design_point, frigate, thesis_sea

__all__ = ["design_point", "frigate", "thesis_sea"]
