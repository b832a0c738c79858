"""What can be wrong with recordings, one idea a file."""
