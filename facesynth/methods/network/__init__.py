"""The network of poses as a method of its own."""
