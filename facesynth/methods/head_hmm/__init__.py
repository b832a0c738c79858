"""Head motion by hidden Markov models over prosody (Deng 2006, §4.4)."""
