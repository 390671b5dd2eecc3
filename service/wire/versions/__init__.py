"""What is told of a version to people who decide: its card, and two versions side by side."""
