"""The stages of a benchmark: simulate, estimate, score, and the run that chains them."""
