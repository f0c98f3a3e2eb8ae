"""``python -m shaftline.studies.policies``."""

from .command import main

main()
