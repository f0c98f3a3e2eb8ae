"""Run a reproduction: ``python -m reproductions NAME [OPTIONS]``; without a name, list them."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent


def commands() -> dict[str, str]:
    """Return the modules with a command by name, such as ``errata`` or ``ferry.engine_map``."""
    modules = {}
    for file in sorted(HERE.rglob("*.py")):
        module = ".".join(file.relative_to(HERE).with_suffix("").parts)
        if "\ndef main(" in file.read_text(encoding="utf-8"):
            modules[module.removesuffix(".page")] = module
    return {n: m for n, m in modules.items() if n != "__main__" and not m.startswith("tests.")}


def main() -> None:
    """Run the command that the first argument names."""
    modules = commands()
    if len(sys.argv) < 2 or sys.argv[1] not in modules:
        print(
            "usage: python -m reproductions NAME [OPTIONS]; NAME is one of\n  "
            + "\n  ".join(modules)
        )
        print("`shaftline reproduce` makes the tables of the five sources.")
        sys.exit(0 if sys.argv[1:2] in ([], ["--help"]) else 2)
    name = sys.argv.pop(1)
    sys.argv[0] = f"python -m reproductions {name}"
    import_module(f"reproductions.{modules[name]}").main()


if __name__ == "__main__":
    main()
