"""Finds scenes, suites and estimators by name: one search order for all three."""
