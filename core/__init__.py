"""What is not physics: compiled machine code, atomic files, sweeps over cores and clusters."""
