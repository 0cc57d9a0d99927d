"""What a suite says, and the cases and trials that follow from it."""
