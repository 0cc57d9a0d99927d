"""What a suite says, and the cases and runs that follow from it."""
