"""What several methods learn with."""
