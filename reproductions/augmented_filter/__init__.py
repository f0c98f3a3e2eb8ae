"""The state-augmented extended Kalman filter of Taylor (2000), and the same on a ship's own plant."""
