"""Stamps are whole nanoseconds: how many there are in the units that settings and messages use."""

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
