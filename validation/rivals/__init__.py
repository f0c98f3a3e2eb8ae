"""What others would do, to be compared with: stepwise BIC and sparse identification."""
