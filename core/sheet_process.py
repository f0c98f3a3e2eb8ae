"""Script that reads one sheet of a spreadsheet in a separate process with limited memory.

The reader is compiled code that allocates the whole rectangle between the first and the last cell, and
terminates its process if it cannot. :mod:`.tables` runs this file as a script, which therefore imports
nothing of the package. Its output is pickled: the names of the sheets, the name of the sheet that was
read, and its table or None.
"""

from __future__ import annotations

import pickle
import sys

LARGEST_BYTES = 2_000_000_000
"""Largest memory of one sheet [bytes]."""


def main() -> None:
    """Read the file in the first argument; the second is the sheet, or the one with most numbers."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (LARGEST_BYTES, LARGEST_BYTES))
    except ImportError:  # Windows has no such limit
        pass
    import pandas as pd

    path, sheet = sys.argv[1:]
    with pd.ExcelFile(path, engine="calamine") as book:
        names = [str(name) for name in book.sheet_names]
        chosen, table, most = sheet or names[0], None, -1
        for name in [name for name in names if sheet in ("", name)]:
            found = book.parse(name, header=None)
            numbers = int(found.apply(pd.to_numeric, errors="coerce").notna().to_numpy().sum())
            if numbers > most:
                chosen, table, most = name, found, numbers
    sys.stdout.buffer.write(pickle.dumps((names, chosen, table)))


if __name__ == "__main__":
    main()
