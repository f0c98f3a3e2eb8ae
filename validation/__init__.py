"""The proof on concealed data: an independent reality, sealed cases, scores."""
