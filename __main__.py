"""``python -m shaftline`` is the command ``shaftline``."""

from .cli.main import main

if __name__ == "__main__":
    main()
