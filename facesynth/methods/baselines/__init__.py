"""Reference methods, without which no figure of another method can be judged."""
