"""The paper on anti-spin: storms with and without."""
