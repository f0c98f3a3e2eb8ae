"""Run the command of the package."""

from .command import main

if __name__ == "__main__":
    main()
