"""Recordings as other systems keep them, on their way into a corpus."""
