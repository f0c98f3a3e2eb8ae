"""Search for formulas of missing physics on simulated ships."""
