"""The paper on the CPP optimiser: its experiment on a ferry."""
