"""Head motion from the voice: nearest recorded movements, or hidden Markov models (Deng 2006, ch. 4)."""
