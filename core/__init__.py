"""Infrastructure without physics: compiled kernels, atomic files, sweeps over cores and clusters."""
