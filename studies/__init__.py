"""Published tables reproduced side by side, a first tour, and the speed of the plant."""
