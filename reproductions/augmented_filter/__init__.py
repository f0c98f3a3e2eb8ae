"""The augmented Kalman filter of Taylor (2000), and the same filter on a ship's own plant."""
