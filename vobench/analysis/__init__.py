"""What is wrong between an estimate and its ground truth, and why."""
