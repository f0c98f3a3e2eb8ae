"""Judge the effects that the search has chosen: held-out data, residual, verdict and correction."""
