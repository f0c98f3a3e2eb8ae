"""Script that reads one sheet of a spreadsheet in a separate process with limited memory.

The reader is compiled code that allocates the whole rectangle between the first and the last cell, and
terminates its process if it cannot. :mod:`.tables` runs this file as a script, which therefore imports
nothing of the package. Its output is a pickled pair: the names of the sheets, and the table or None.
"""

from __future__ import annotations

import pickle
import sys

LARGEST_BYTES = 2_000_000_000
"""Largest memory of one sheet [bytes]."""


def main() -> None:
    """Read the file in the first argument; the second is the sheet, by default the first one."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (LARGEST_BYTES, LARGEST_BYTES))
    except ImportError:  # Windows has no such limit
        pass
    import pandas as pd

    path, sheet = sys.argv[1:]
    with pd.ExcelFile(path, engine="calamine") as book:
        names = [str(name) for name in book.sheet_names]
        wanted = sheet or names[0]
        table = book.parse(wanted, header=None) if wanted in names else None
    sys.stdout.buffer.write(pickle.dumps((names, table)))


if __name__ == "__main__":
    main()
