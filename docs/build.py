"""Build the documentation site with its notebooks run: one folder per version and an index page."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent


def main() -> int:
    """Build the site and return the exit code of Sphinx."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/site"), help="folder of all versions")
    out = parser.parse_args().out
    site = out / version("shaftline")
    # The cache is kept between builds, so that only notebooks with a changed text are run again.
    cache = out / ".cache"
    # Notebooks call the commands of the Python that builds them.
    search_path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    sphinx = subprocess.run(
        [sys.executable, "-m", "sphinx", "-b", "html", "-E", "-q", "--fail-on-warning", "--keep-going",
         "-d", str(cache / "doctrees"),
         "-D", f"nb_execution_cache_path={(cache / 'notebooks').resolve()}",
         str(HERE), str(site)],
        check=False, env=os.environ | {"PATH": search_path},
    )  # fmt: skip
    if sphinx.returncode:
        return sphinx.returncode
    for notebook in (out / "jupyter_execute").rglob("*.ipynb"):  # with their output
        shutil.copy(notebook, site / "notebooks" / notebook.name)
    shutil.rmtree(out / "jupyter_execute", ignore_errors=True)
    versions = sorted((p.parent.name for p in out.glob("*/index.html")), reverse=True)
    (out / "versions.js").write_text(f"window.shaftlineVersions = {json.dumps(versions)};\n")
    (out / "index.html").write_text(
        f'<!doctype html><meta http-equiv="refresh" content="0; url={site.name}/index.html">\n'
    )
    print(f"the site: {out / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
