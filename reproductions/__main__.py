"""Run a reproduction: ``python -m reproductions NAME [OPTIONS]``; without a name, list them."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent


def names() -> list[str]:
    """Return the names of all modules with a command, such as ``errata`` or ``ferry.engine_map``."""
    found = []
    for file in sorted(HERE.rglob("*.py")):
        parts = file.relative_to(HERE).with_suffix("").parts
        if "tests" not in parts and "\ndef main(" in file.read_text(encoding="utf-8"):
            found.append(".".join(parts).removesuffix(".command"))
    return [name for name in found if name != "__main__"]


def main() -> None:
    """Run the command that the first argument names."""
    if len(sys.argv) < 2 or sys.argv[1] not in names():
        print(
            "usage: python -m reproductions NAME [OPTIONS]; NAME is one of\n  "
            + "\n  ".join(names())
        )
        print("The tables of the five sources are made by `shaftline reproduce`.")
        sys.exit(0 if sys.argv[1:2] in ([], ["--help"]) else 2)
    name = sys.argv.pop(1)
    path = "/".join(name.split("."))
    module = f"{name}.command" if (HERE / path / "command.py").is_file() else name
    sys.argv[0] = f"python -m reproductions {name}"
    import_module(f"reproductions.{module}").main()


if __name__ == "__main__":
    main()
