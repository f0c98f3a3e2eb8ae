"""What speaks for and against what the search has found."""
