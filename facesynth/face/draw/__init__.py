"""Pictures of heads, drawn by the processor alone."""
