"""Scores of an estimate against the ground truth: errors on arrays, statistics, coverage. Pure."""
