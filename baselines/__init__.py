"""Classic controllers: governor, combinator, CPP optimiser, anti-spin; each with ``predict``."""
