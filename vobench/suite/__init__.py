"""Suites, scenarios and scenes in YAML, and the cases and trials that follow from them."""
