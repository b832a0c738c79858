"""The zoo: one room per method."""
