"""Runs plans: the stages, the store of finished results, and the folder of a run."""
