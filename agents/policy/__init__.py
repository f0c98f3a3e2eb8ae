"""Policy file: weights of a network and the environment for which it was trained."""
