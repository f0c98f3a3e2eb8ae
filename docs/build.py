"""Build the site: a folder a version, its notebooks run, and a page that leads to the newest."""

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
    """Build it; the exit code is Sphinx's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/site"), help="folder of all versions")
    out = parser.parse_args().out
    made = out / version("shaftline")
    # kept between builds, so that a notebook is run again only where its text has changed
    kept = out / ".cache"
    # notebooks call the commands of the Python that builds them
    found = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-b", "html", "-E", "-q", "--fail-on-warning", "--keep-going",
         "-d", str(kept / "doctrees"), "-D", f"nb_execution_cache_path={(kept / 'notebooks').resolve()}",
         str(HERE), str(made)],
        check=False, env=os.environ | {"PATH": found},
    )  # fmt: skip
    if done.returncode:
        return done.returncode
    for notebook in (out / "jupyter_execute").rglob("*.ipynb"):  # with what they gave
        shutil.copy(notebook, made / "notebooks" / notebook.name)
    shutil.rmtree(out / "jupyter_execute", ignore_errors=True)
    versions = sorted((p.parent.name for p in out.glob("*/index.html")), reverse=True)
    (out / "versions.js").write_text(f"window.shaftlineVersions = {json.dumps(versions)};\n")
    (out / "index.html").write_text(
        f'<!doctype html><meta http-equiv="refresh" content="0; url={made.name}/index.html">\n'
    )
    print(f"the site: {out / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
